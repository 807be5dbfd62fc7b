"""How commands become a tree: plans of nodes (immutable data), their wiring, and the subtrees of each command."""
