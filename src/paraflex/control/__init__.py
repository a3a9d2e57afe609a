"""Simulations one can step, sampled controllers, control laws and their design, input shapers."""
