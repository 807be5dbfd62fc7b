"""Reads structured sentences as steps of a mission: conditions, loops, waits and sequences."""
