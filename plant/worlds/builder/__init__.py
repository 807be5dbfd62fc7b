"""Builders of worlds: the folder of a world from a map or from cylinders."""
