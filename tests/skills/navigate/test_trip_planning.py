"""When the robot asks a person to let it pass, and thanks them."""

from types import SimpleNamespace

import pytest

from skills.navigate.trip_planning import PassRequest
from skills.robot import Pose2D

KIM = SimpleNamespace(place_W=(1.0, 0.0))


class Stage:
    """A robot that stands before somebody, at 1 Hz."""

    def __init__(self):
        self.now_s, self.x_m, self.people, self.said = 0.0, 0.0, [KIM], []
        self.context = SimpleNamespace(
            robot=SimpleNamespace(name="alice"),
            clock=SimpleNamespace(now=lambda: self.now_s),
            pose=lambda: Pose2D(self.x_m, 0.0, 0.0),
            silent_zone=lambda: None,
            publish=lambda topic, message: self.said.append((message["t"], message["text"])),
        )
        self.request = PassRequest(self.context)

    def ticks(self, seconds, m_s=0.0):
        for _ in range(seconds):
            self.request.update(lambda: next(iter(self.people), None), lambda: self.people)
            self.now_s, self.x_m = self.now_s + 1.0, self.x_m + m_s
        return self


ASKS, THANKS = "May I pass, please?", "Thank you."


def test_robot_asks_after_eight_seconds_and_once_more():
    stage = Stage().ticks(40)
    assert stage.said == [(8.0, ASKS), (16.0, ASKS)] and stage.request.refused


@pytest.mark.parametrize(("left", "thanks"), [(True, [THANKS]), (False, [])])
def test_robot_thanks_a_person_who_made_way_when_it_drives_on(left, thanks):
    stage = Stage().ticks(10)
    assert stage.request.awaited_W == KIM.place_W
    stage.people = [SimpleNamespace(place_W=(1.0, 1.0))] if left else [KIM]
    assert [text for _, text in stage.ticks(3, m_s=0.5).said] == [ASKS, *thanks]
    assert stage.request.awaited_W is None


def test_robot_asks_nobody_while_it_drives_or_is_alone():
    stage = Stage().ticks(30, m_s=0.4)
    stage.people = []
    assert stage.ticks(30).said == [] and not stage.request.refused
