"""Sensitivity studies: derivatives of metrics with respect to numbers of the mechanism's file."""
