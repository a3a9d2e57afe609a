"""Commands as the shell sees them: arguments, options and help. The modules of `paraflex.cli` do their work."""
