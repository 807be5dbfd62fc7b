"""Makes maps, and objects, worlds and robots of the user's own."""
