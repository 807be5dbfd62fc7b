"""Holding a thing out to a person."""
