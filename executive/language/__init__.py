"""Understanding of English requests."""
