"""The command line: thin commands over the library."""

# Exit codes; that of what was interrupted is a matter of the signal: see `signals.exit_code`.
COMPLETE, TROUBLE, BAD_INPUT = 0, 1, 2
