"""The event log: written as MCAP while a mission runs, read back afterwards."""
