"""Detectors that run networks which other tools exported to ONNX."""
