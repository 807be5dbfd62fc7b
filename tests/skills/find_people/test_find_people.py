"""Where find_people says that somebody is."""

import math

from planar_robot import TWO_ROOMS, Bench, Box

from skills.api import Running, Succeeded
from skills.find_people.skill import FindPeople, FindPeopleInputs
from skills.robot import Pose2D

ROOM = tuple((x, y) for x, y in ((0.2, 0.2), (4.8, 0.2), (4.8, 3.8), (0.2, 3.8)))


def test_the_observation_is_where_somebody_stands():
    # a body 0.4 m wide at (3.0, 2.0), seen by the LiDAR from (1.5, 2.0)
    bench = Bench(Pose2D(1.5, 2.0, 0.0), unmapped=(Box(2.8, 1.8, 3.2, 2.2),), surveyed=TWO_ROOMS, cameras=False)
    for _ in range(10):
        bench.tick()
    skill = FindPeople(bench.context())
    skill.begin(FindPeopleInputs(ROOM, "room"))
    while isinstance(step := skill.step(), Running):
        bench.tick()
    skill.end()
    assert isinstance(step, Succeeded)
    assert math.dist(step.outputs["observation"].position_W[:2], (3.0, 2.0)) < 0.3
