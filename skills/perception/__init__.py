"""Perception from pictures and scans: objects, surfaces, doorways, and people."""
