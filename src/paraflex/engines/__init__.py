"""Other people's engines on the same mechanism, torques and start: adapters for comparison."""
