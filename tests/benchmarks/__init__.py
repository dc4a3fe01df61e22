"""Benchmarks: `./bayesindent dev bench NAME` runs `bench_NAME.py`; other modules here serve
benchmarks only.
"""
