"""The check_door skill."""
