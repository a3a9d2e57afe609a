"""The sampled loop around control laws: readings, references, torques, and simulations under controllers."""
