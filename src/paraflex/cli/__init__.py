"""Command line of paraflex: thin commands over the library."""

# Exit codes; that of an interrupted command depends on the signal: see `signals.exit_code`.
COMPLETE, FAILURE, BAD_INPUT = 0, 1, 2
