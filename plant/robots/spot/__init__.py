"""The simulated Spot behind the Robot protocol."""
