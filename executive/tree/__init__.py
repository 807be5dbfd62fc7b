"""Compiles missions to behaviour trees, defines the nodes, and checks and estimates missions before a run."""
