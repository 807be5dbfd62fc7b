"""Recognises and understands speech, and speaks."""
