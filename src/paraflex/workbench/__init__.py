"""Workbench: a page on which a mechanism is drawn, moved and run, in a browser or in a notebook."""
