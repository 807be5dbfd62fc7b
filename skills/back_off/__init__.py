"""Getting a little away from what blocks the path."""
