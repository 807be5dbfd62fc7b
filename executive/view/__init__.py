"""Views of a tree: text, SVG and JSON, before, while and after it runs."""
