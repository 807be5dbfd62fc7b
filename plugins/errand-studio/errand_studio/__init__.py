"""Browser studio: writes, checks, runs and compares missions."""
