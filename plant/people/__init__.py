"""People in the plant: they walk on routes, and receive objects from robots."""
