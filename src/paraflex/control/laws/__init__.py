"""Control laws: what a controller computes from its readings, and descriptions of laws in files."""
