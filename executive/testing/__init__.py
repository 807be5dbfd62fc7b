"""Tools that test skills: a bench that runs one skill in its leaf, tests as YAML, and a suite for every skill."""
