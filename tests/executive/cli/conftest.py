"""Lets the tests here import the small detector that lies with the skills' tests."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "skills"))
