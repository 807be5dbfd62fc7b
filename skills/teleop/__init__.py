"""Driving body and arm by hand."""
