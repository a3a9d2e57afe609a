"""Sampled control: controllers with their chain, design by linear models, margins."""
