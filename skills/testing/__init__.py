"""Tools for testing skills: a clock driven by the test, and a scripted robot with exact estimators in a small world."""
