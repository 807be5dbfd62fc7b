"""Finding things with the hand camera."""
