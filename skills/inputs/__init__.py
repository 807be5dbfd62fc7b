"""Inputs of users: guarded reading of files and texts, YAML reader, schema check, and the error of bad input."""
