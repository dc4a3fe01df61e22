"""Each command as a stage, and the store of simulations."""
