"""Running trees: the only place that advances time, ticks, and holds the robots."""
