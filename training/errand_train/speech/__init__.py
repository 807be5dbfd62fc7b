"""Trains the adapter with which the recogniser hears in noise."""
