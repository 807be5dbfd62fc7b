"""Sensors of the plant: each turns the simulator's truth into a reading as noisy as the real one, from a seed."""
