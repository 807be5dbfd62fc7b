"""Tools to test skills: a bench that runs one skill in its leaf, tests in YAML, and a suite for every skill."""
