"""Input of users: guarded reading of files and texts, the YAML reader, the schema check, and the error of bad input."""
