"""Pytest plug-in: fixtures, the small plant, and the collection of `*.skilltest.yaml` files."""
