"""The detector of things in pictures: a cascade of three small networks in ONNX Runtime."""
