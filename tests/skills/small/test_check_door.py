"""The check_door skill waits until a person has left the doorway."""

import pytest

from executive.testing.bench import scripted_bench
from skills.api import Running, Succeeded
from skills.small.check_door import CheckDoor, CheckDoorInputs
from skills.testing.blocks import Block
from skills.testing.robot import BASE_ONLY

WALL = (Block(1.45, 0.45, 1.55, 2.5), Block(1.45, -2.5, 1.55, -0.45), Block(4.0, -3.0, 4.1, 3.0))
SOMEBODY = Block(1.35, -0.2, 1.65, 0.2, 0.0, 1.7)


def test_it_looks_again_once_somebody_has_gone_on():
    bench, robot = scripted_bench(BASE_ONLY, blocks=(*WALL, SOMEBODY))
    said = []
    skill = CheckDoor(bench.context())
    skill.begin(CheckDoorInputs((1.5, 0.0), 0.9, 0.0, "kitchen door"))
    while isinstance(step := skill.step(), Running):
        bench.clock.advance(0.1)
        said.append(step.message)
        if "waiting" in step.message and SOMEBODY in robot.blocks:
            robot.blocks.remove(SOMEBODY)
    skill.end()
    assert isinstance(step, Succeeded)
    assert step.outputs["open"] is True
    assert step.outputs["free_m"] == pytest.approx(0.9, abs=0.1)
    assert "waiting until more is seen of the kitchen door" in said
    assert robot.moving_parts == ()
