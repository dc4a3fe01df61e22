"""Finite element simulations of indentation."""
