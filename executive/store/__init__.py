"""The durable store: missions queued and under way, and how far each has come."""
