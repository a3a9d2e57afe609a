"""Derivatives of the runs of a design by its parameters, from those of its system, motion and torques."""
