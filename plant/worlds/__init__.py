"""Worlds: rooms, furniture, maps and knowledge in folders, their loader, and where the seed puts the things."""
