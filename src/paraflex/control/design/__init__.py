"""Design by linear models: sampled plants, LQR and LQG, closed loops and their margins, gains of rate feedback."""
