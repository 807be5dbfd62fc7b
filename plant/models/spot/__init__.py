"""Boston Dynamics Spot with arm: facts, and the model that is made of them."""
