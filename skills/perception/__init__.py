"""Perception: the detector, and how it is trained."""
