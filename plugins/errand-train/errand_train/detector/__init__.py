"""Trains the networks of the detector on rendered pictures, exports and scores them."""
