"""Step 1: the surrogate of the indentation modulus and how it is built."""
