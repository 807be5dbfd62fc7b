"""Grasping an object that was seen."""
