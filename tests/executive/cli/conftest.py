"""Lets the tests here import the skills' small detector, the made speech of the speech's tests, and a backend."""

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2] / "skills"), str(Path(__file__).parents[1] / "speech")]
sys.path.append(str(Path(__file__).parent))
