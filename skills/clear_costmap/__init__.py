"""Forgetting what was seen on the path, to see it anew."""
