"""The charge skill."""
