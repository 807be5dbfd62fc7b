"""The stow skill."""
