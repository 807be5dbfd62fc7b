"""The collision guard stops the robot for moving obstacles, and for sudden ones."""

from dataclasses import replace

import numpy as np
import pytest
from planar_people import person_at
from planar_robot import OUTLINE, Bench

from skills.api import Running, Succeeded
from skills.footprint import Footprint, disc_centres, pose_array
from skills.navigate.collision_guard import CollisionGuard
from skills.navigate.skill import Navigate, NavigateInputs
from skills.navigate.surroundings import NavigateOptions
from skills.robot import Pose2D

FOOTPRINT = Footprint.rectangle(OUTLINE)
START, GOAL = Pose2D(1.2, 5.6, 0.0), Pose2D(6.8, 5.6, 0.0)


class Drive:
    """A drive along the corridor, with a person at `place(time_s, robot_x)` or, while that is None, without."""

    def __init__(self, place, *, options=None, most_s=60.0):
        self.bench = Bench(START)
        fixed = list(self.bench.robot.blocks)
        skill = Navigate(self.bench.context(), options)
        skill.begin(NavigateInputs(GOAL))
        self.gaps, self.messages, step = [], [], skill.step()
        while isinstance(step, Running) and self.bench.clock.now() < most_s:
            self.messages.append(step.message)
            x, there = self.bench.robot.pose.x_m, None
            there = place(self.bench.clock.now(), x)
            self.bench.robot.blocks[:] = fixed if there is None else [*fixed, person_at(*there)]
            self.bench.tick()
            if there is not None:
                speed = float(np.hypot(*self.bench.robot.velocity[:2]))
                self.gaps.append((self.gap_m(there), speed, x))
            step = skill.step()
        skill.end()
        self.step = step

    def gap_m(self, there):
        """From the outline to the axis of the person."""
        centres = disc_centres(FOOTPRINT.discs, pose_array([self.bench.robot.pose]))[0]
        return float(np.min(np.linalg.norm(centres - there, axis=1) - FOOTPRINT.discs[:, 2]))

    def nearest_while_moving_m(self):
        """The least gap while the robot moves; once somebody walks through it, as nobody can, it counts no more."""
        through = next((n for n, (gap, _, _) in enumerate(self.gaps) if gap < 0.0), len(self.gaps))
        return min((gap for gap, speed, _ in self.gaps[:through] if speed > 0.05), default=np.inf)

    def stood(self):
        return [one for one in self.messages if "an obstacle comes into the path" in one]


class Crossing:
    """A person who walks across from y to y at a speed, once the robot has come to `from_x`."""

    def __init__(self, x, y0, y1, from_x, speed_m_s=1.2):
        self.x, self.y0, self.y1, self.from_x, self.speed_m_s, self.since_s = x, y0, y1, from_x, speed_m_s, None

    def __call__(self, now_s, robot_x):
        if robot_x >= self.from_x and self.since_s is None:
            self.since_s = now_s
        walked_m = 0.0 if self.since_s is None else min(abs(self.y1 - self.y0), self.speed_m_s * (now_s - self.since_s))
        return self.x, self.y0 + np.sign(self.y1 - self.y0) * walked_m


@pytest.mark.parametrize("from_x", [2.0, 2.7, 3.3])
def test_robot_waits_while_a_person_crosses(from_x):
    drive = Drive(Crossing(4.0, 4.4, 6.7, from_x))
    assert drive.nearest_while_moving_m() > 0.25
    assert isinstance(drive.step, Succeeded)


def test_guard_brakes_harder_for_a_person_who_appears_just_ahead(monkeypatch):
    def just_ahead(now_s, x):
        return (4.6, 5.6) if x > 3.58 else None

    drive = Drive(just_ahead, most_s=9.0)
    monkeypatch.setattr(CollisionGuard, "danger", lambda *_: None)
    without = Drive(just_ahead, most_s=9.0)
    assert drive.stood() and not without.stood()
    assert drive.nearest_while_moving_m() > max(0.2, without.nearest_while_moving_m() + 0.03)


@pytest.mark.parametrize(
    "place",
    [
        lambda now_s, x: (1.5 + 0.6 * now_s, 4.5),
        lambda now_s, x: (4.6, 4.6),
        lambda now_s, x: (3.2 + 0.9 * now_s, 5.6) if now_s < 5.5 else None,
        lambda now_s, x: (max(0.3, x - 1.2), 5.6),
    ],
    ids=["walks beside the path", "stands beside the path", "walks away ahead", "follows"],
)
def test_a_person_does_not_stop_the_robot(place):
    drive = Drive(place)
    assert not drive.stood() and isinstance(drive.step, Succeeded)


def test_the_margin_is_an_option():
    options = NavigateOptions()
    wide = replace(options, guard=replace(options.guard, margin_m=1.0))
    assert Drive(lambda now_s, x: (1.5 + 0.6 * now_s, 4.5), options=wide, most_s=15.0).stood()
