"""Labelled pictures of objects in random rooms, for training and evaluation of a detector."""
