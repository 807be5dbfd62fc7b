"""Choosing a place to stand from which an object is within reach, and going there."""
