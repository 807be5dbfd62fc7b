"""Charging the battery at the dock."""
