"""Evaluation at scale: a scenario file becomes runs, runs become results in one file, and results a report."""
