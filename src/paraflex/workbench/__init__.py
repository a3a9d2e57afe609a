"""The workbench: a page on which mechanisms are drawn, moved and run, and the host that serves it."""
