"""Getting a little away from what blocks the way."""
