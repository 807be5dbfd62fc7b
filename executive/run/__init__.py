"""Runs of trees: the only place that advances time, ticks trees, and holds the leases of robots."""
