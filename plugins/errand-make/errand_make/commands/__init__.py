"""Commands of errand-make."""
