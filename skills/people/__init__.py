"""Skills that find people."""
