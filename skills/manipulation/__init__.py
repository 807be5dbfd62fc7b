"""Manipulation: the skills that use the arm, and the arm's motion, collisions, poses and forces that they share."""
