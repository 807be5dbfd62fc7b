"""Builds the worlds' shells, furniture and maps: `python -m plant.worlds.builder`."""
