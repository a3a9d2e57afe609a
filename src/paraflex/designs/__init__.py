"""Designs: values of the parameters of a model, and the metrics of its runs."""
