"""Nodes of trees by concept: each page has the plans and the py_trees behaviours."""
