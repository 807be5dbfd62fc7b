"""Models of robots and objects: SDF files, their visual meshes, and the scripts that made them."""
