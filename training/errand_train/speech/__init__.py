"""Training of the adapter with which the recogniser hears in noise; needs the extra `train`."""
