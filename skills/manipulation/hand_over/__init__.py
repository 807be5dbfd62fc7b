"""Holding an object out to a person."""
