"""Expressions of parameters, units and the time: their values, derivatives and dimensions."""
