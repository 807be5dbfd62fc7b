"""The nodes of trees by concept: how each is planned, and what it does."""
