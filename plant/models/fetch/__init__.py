"""The Fetch mobile manipulator: facts, and the model that is made of them."""
