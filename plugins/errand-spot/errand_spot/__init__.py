"""Boston Dynamics' API of Spot: a server of it in simulation, and missions with a real Spot."""
