"""Looking about for people."""
