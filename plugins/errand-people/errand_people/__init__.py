"""Plug-in of Errand: it follows, guides, meets, greets and asks people."""
