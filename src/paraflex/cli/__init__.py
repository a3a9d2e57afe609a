"""The command line: thin commands over the library."""

# Exit codes.
COMPLETE, TROUBLE, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
