"""Durable store of missions, queued and under way, with the progress of each."""
