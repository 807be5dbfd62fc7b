"""Worlds of the user's own: from maps or cylinders, with additions and zones; plans as pictures."""
