"""Models of objects and people: SDF files with their meshes, their catalogue, and the import of meshes."""
