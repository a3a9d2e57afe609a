"""Sweeps: thousands of runs of a mechanism with varied parameters, collected in one table."""
