"""Durable store for missions that are queued or under way, and for the progress of each mission."""
