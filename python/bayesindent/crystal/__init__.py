"""Single crystals: stiffness, anisotropy, the exact theory of the indented half-space."""
