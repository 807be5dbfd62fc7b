"""The nodes that a compiled tree is made of: py_trees behaviours that tell why they did not succeed."""
