"""Preparation of a request: its mission, compiled for each robot and checked on the world's map."""
