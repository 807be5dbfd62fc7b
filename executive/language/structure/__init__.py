"""Sentences that decide, repeat, wait and go on: what they mean as the steps of a mission."""
