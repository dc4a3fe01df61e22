"""Step 2: the constants behind measured moduli, and what to measure next."""
