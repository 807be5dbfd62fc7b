"""The detect skill: finds objects with the hand camera."""
