"""Spot's capabilities, for robots with an arm."""

import pytest

from plant.robots.spot.kind import spot_capabilities


@pytest.fixture(scope="session")
def spot():
    return spot_capabilities()
