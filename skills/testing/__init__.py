"""Tools to test skills: a clock that the test moves, and a scripted robot with exact estimators in a small world."""
