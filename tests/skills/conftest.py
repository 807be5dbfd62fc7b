"""Makes the robots and scenes of this folder importable."""

import sys
from pathlib import Path

import pytest

from plant.robots.spot.kind import spot_capabilities

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def spot():
    """Spot's capabilities, for robots with an arm."""
    return spot_capabilities()
