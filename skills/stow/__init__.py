"""Folding the arm away."""
