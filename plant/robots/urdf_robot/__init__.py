"""Robots of the user: a URDF file and a YAML file that names its parts become a kind of robot."""
