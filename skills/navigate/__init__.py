"""Going to a place: a planned path, followed with checks."""
