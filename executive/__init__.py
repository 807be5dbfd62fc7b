"""Executive: from a sentence to a ticking behaviour tree."""
