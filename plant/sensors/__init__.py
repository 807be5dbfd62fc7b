"""Sensors of the plant: measurements of the true state with realistic noise, from a seed."""
