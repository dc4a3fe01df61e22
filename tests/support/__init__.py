"""Helpers that tests, benchmarks and tools share; pyproject.toml puts `tests/` on pytest's path."""
