"""Event log of a run: written as MCAP while missions run, read back afterwards."""
