"""Namelists and tables, read and checked by the core."""
