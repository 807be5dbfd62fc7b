"""User inputs: guarded reading of files and texts, YAML reader, schema check, and the error for bad input."""
