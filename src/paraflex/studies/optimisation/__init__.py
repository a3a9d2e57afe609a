"""Searches for designs: optimisation, identification, and Sobol indices."""
