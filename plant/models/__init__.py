"""Models of robots and things: SDF files, their looks, and the scripts that made them."""
