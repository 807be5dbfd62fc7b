"""Missions of several robots: auction, assignment, hand-over between two, and the run."""
