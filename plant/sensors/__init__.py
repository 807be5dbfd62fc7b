"""Sensors of the plant: they turn the true state into readings with realistic noise, from a seed."""
