"""Finding objects with the hand camera."""
