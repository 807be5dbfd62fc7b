"""Understands English requests."""
