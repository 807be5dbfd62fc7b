"""Putting a held object down on a surface."""
