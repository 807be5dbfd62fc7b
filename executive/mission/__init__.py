"""Reads, parses and resolves missions, from files or from sentences."""
