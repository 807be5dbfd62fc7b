"""Structured sentences, which decide, repeat, wait and go on, as steps of a mission."""
