"""Generator of the shells, furniture and maps of the worlds that come with Errand: `python -m errand_train.worlds`."""
