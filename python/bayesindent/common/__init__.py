"""Files of results and progress, which all steps use."""
