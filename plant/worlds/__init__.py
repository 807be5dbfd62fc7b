"""Worlds: rooms, furniture, maps and knowledge in folders, their loader, and the placement of objects by the seed."""
