"""The place skill."""
