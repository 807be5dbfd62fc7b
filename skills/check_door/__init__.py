"""Looking whether a door is open."""
