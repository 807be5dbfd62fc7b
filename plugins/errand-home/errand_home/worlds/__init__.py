"""Worlds; each is a folder."""
