"""Choosing a place to stand from which a thing is within reach, and going there."""
