"""Workbench: a page on which mechanisms are drawn, moved and computed; the text of the model file is its state."""
