"""Sweeps: thousands of runs of a mechanism whose numbers vary, as one table."""
