"""Meshes, shapes and SDF files of models; makes a model of a mesh of any program (`importing`)."""
