"""Generator of the object models that come with Errand: `python -m errand_train.models`."""
