"""The stages of a run, and its folder of results."""
