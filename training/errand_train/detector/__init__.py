"""How the detector is made: network, training on rendered pictures, export. Needs the extra `train` (torch)."""
