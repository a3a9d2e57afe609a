"""Descriptions of charts and tables, in SI units, which `plots`, `report`, `cli` and notebooks draw."""
