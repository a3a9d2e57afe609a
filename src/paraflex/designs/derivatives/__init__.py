"""Derivatives of the runs of a design by its numbers: what moves with them, and what runs and metrics make of that."""
