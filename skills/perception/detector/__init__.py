"""Detector of objects in pictures: a cascade of three small networks in ONNX Runtime."""
