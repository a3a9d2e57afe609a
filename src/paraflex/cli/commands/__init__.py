"""The commands as a shell sees them: their arguments, options and help. What they do is in the other modules."""
