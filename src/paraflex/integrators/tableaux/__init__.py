"""ESDIRK schemes, one per file, with their Butcher tableaux: explicit first stage, one diagonal, stiffly accurate."""
