"""ESDIRK schemes, a file each, with their Butcher tableaux: explicit first stage, one diagonal, stiffly accurate."""
