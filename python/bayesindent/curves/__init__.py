"""Step 0: from measured curves to moduli."""
