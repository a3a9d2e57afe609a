"""Optimisation, parameter identification, and Sobol indices."""
