"""Putting a held thing down on a surface."""
