"""Faults by name, injected into any robot: in tests of skills, and in runs from the command line."""
