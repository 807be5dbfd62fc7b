"""Manipulation: the skills that use the arm, and their shared motions, collisions, poses and forces."""
