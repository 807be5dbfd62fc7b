"""Forgetting what was seen in the way, to see it anew."""
