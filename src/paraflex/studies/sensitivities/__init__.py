"""Sensitivities: derivatives of metrics by any numbers of the mechanism's file."""
