"""The back_off skill."""
