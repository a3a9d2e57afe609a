"""Sampled controllers, references and input shapers."""
