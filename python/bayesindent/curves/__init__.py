"""Measured curves of load and depth."""
