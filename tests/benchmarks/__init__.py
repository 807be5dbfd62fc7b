"""Benchmarks; those of a plug-in use the helpers of its tests."""

import sys
from pathlib import Path

sys.path += map(str, Path(__file__).parents[2].glob("plugins/*/tests"))
