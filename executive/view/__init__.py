"""Shows runs: trees as text, SVG and JSON, the live page, the map, and report pages."""
