"""Grasping a thing that was seen."""
