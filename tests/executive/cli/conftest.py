"""Lets the tests here import the skills' small detector, the made speech of the speech's tests, and a backend."""

import sys
from functools import cache
from pathlib import Path

import pytest

from executive.cli import entry

sys.path[:0] = [str(Path(__file__).parents[2] / "skills"), str(Path(__file__).parents[1] / "speech")]
sys.path.append(str(Path(__file__).parent))


@pytest.fixture(autouse=True, scope="session")
def commands_are_built_once():
    """A process calls one command; the tests call each of them many times."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(entry, "shipped_command", cache(entry.shipped_command))
        yield
