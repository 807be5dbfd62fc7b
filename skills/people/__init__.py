"""Skills that find, meet, follow and guide people."""
