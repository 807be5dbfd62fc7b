"""Evaluation at scale: an evaluation file gives runs, runs give results in one file, and results give a report."""
