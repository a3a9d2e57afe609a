"""Designs looked for: what minimises metrics, what reproduces them, and which parameters matter at all."""
