"""Builders of models: meshes, shapes and SDF files, and the import of mesh files (`importing`)."""
