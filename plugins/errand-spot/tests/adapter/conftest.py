"""A scripted Spot before a wall, its server, and an adapter's robot in lock-step with it."""

from contextlib import closing
from functools import partial

import pytest
from lock_step import LockStep, scripted

from skills.testing.blocks import Block


@pytest.fixture
def step(credentials, monkeypatch):
    """The robot as its server starts it; motors that are switched on have power at the next step."""
    monkeypatch.setattr("errand_spot.server.computer.POWER_ON_S", 0.0)
    with closing(LockStep(partial(scripted, blocks=[Block(3.0, -1.5, 3.2, 1.5)]), credentials)) as made:
        yield made


@pytest.fixture
def powered(step):
    """The robot with motors on and its `lease`; it still sits."""
    step.lease = step.robot.acquire_lease("test")
    step.connection.power(True)
    assert step.until(lambda: step.robot.powered)
    return step


@pytest.fixture
def standing(step):
    """The robot on its feet, with its `lease`."""
    step.stand_up()
    step.lease = step.robot.acquire_lease("test")
    return step
