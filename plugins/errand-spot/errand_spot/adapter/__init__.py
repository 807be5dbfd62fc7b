"""Adapter: a robot of this project that drives a Spot through its API."""
