"""Designs: the numbers of a model that vary, and what their runs are judged by."""
