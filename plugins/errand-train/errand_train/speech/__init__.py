"""Training of the adapter with which the recogniser understands speech in noise."""
