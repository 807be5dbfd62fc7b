"""Makes the robots and scenes of this folder importable."""

import sys
from pathlib import Path

import pytest

from plant.robots.spot.kind import spot_capabilities

sys.path.insert(0, str(Path(__file__).parent))


def pytest_errand_skill_tests(settings):
    """Cancels and freezes each skill at four ticks of its run, half of what authors of other skills get."""
    settings.samples = 4


@pytest.fixture(scope="session")
def spot():
    """Spot's capabilities, for robots with an arm."""
    return spot_capabilities()
