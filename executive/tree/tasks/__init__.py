"""Tasks of commands, each a page of its own."""
