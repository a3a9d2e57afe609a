"""Derivatives of the runs of a design with respect to its parameters, from those of system, motion and torques."""
