"""Kinds of nodes, one page for each concept: its plans and its py_trees behaviours."""
