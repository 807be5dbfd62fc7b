"""The locate_dock skill."""
