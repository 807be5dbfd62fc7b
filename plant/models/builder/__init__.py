"""Builds the object models of `plant/models`: `python -m plant.models.builder`."""
