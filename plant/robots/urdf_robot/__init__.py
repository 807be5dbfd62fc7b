"""Robots of one's own: a URDF file and a YAML file that names its parts become a kind of robot."""
