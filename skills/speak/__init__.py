"""The speak skill."""
