"""Behaviour trees of missions: the compiler, the nodes, and the checks and estimates before a run."""
