"""Robots from URDFs: their parts are inferred, their meshes copied, and their packages written."""
