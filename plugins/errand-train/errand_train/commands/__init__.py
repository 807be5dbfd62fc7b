"""`errand dataset`: renders labelled pictures, trains the networks of the detector on them, and scores it."""
