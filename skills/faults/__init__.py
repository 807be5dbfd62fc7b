"""Faults by name, injected around any robot: in tests of skills, and in runs from the command line."""
