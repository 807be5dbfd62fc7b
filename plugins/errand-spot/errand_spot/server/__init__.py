"""Server of Spot's API for a simulated robot: programs written with the SDK run against it unchanged."""
