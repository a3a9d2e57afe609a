"""Input shaping: shapers, and shaped paths and torques."""
