"""Missions: their files, and missions made of sentences."""
