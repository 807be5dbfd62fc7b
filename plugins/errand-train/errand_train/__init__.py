"""Generators of Errand's data: labelled pictures, networks, the speech adapter, and the shipped models and worlds."""
