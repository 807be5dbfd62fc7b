"""`errand teleop`: the plant's robot driven by hand, the page's actions, a lease that another holds, bad input."""

import json
import math

import numpy as np
import pytest
from pydrake.math import RollPitchYaw

from errand_teleop.commands import TerminalKeys, advance, context_for
from errand_teleop.driver import Teleop, TeleopOptions
from errand_teleop.page import TeleopPage
from executive.app.prepare.placed_robots import only_robot
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.app.runs.simulated import simulate
from executive.testing.bench import SkillBench
from executive.view.feed import Feed
from executive.view.page_control import RefusedError
from plant.robots.spot.kind import spot_capabilities
from skills.inputs.errors import InputError
from skills.manipulation.arm.kinematics import arm_model
from skills.robot import Pose2D
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot
from tests.executive.cli.calls import refused_in_one_line

OPTIONS = TeleopOptions()


class Asked:
    """Notes what is asked."""

    def __init__(self):
        self.last = None

    def ask(self, asked):
        self.last = asked


def test_a_key_at_the_terminal_asks_for_its_axis_and_any_other_stops():
    hands = Asked()
    keys = TerminalKeys(hands, lambda name: "saved", lambda text: None)
    keys.press("w")
    assert hands.last == {"forward": 1.0}
    keys.press(" ")
    assert hands.last == {}


def test_the_save_key_saves_and_says_so():
    said = []
    TerminalKeys(Asked(), lambda name: f"saved {name}", said.append).press("p")
    assert said == ["saved None"]


@pytest.fixture
def bench():
    clock = VirtualClock()
    return SkillBench(ScriptedRobot(clock, capabilities=spot_capabilities()), clock)


def live_of(feed):
    """The latest words of a feed by what they are about, and all messages by topic."""
    said = [json.loads(text) for text in feed.since((0, 0))[1]]
    messages = [(each["topic"], each["data"]) for each in said if "topic" in each]
    return {each["live"]: each["data"] for each in said if "live" in each}, messages


def test_the_page_asks_and_nonsense_is_refused(bench):
    hands = Asked()
    actions = TeleopPage(hands, bench.context(), Feed(), lambda name: f"saved {name}").actions()
    actions["teleop"]({"keys": ["w"], "axes": {"turn": 0.5}})
    assert hands.last == {"forward": 1.0, "turn": 0.5}
    with pytest.raises(RefusedError, match="axis 'warp'"):
        actions["teleop"]({"axes": {"warp": 1.0}})
    assert actions["save_pose"]({"name": "look"}) == "saved look"


def test_the_stop_button_of_the_page_holds_until_it_is_released(bench):
    hands, feed = Asked(), Feed()
    actions = TeleopPage(hands, bench.context(), feed).actions()
    assert live_of(feed)[0]["control"]["mode"] == "running"
    actions["teleop"]({"keys": ["w"]})
    actions["stop"]({})
    assert (hands.last, live_of(feed)[0]["control"]["mode"]) == ({}, "stopped")
    with pytest.raises(RefusedError, match="release it to drive"):
        actions["teleop"]({"keys": ["w"]})
    assert hands.last == {}
    actions["release"]({})
    actions["teleop"]({"keys": ["w"]})
    assert hands.last == {"forward": 1.0}
    told = [(data["what"], data["message"]) for topic, data in live_of(feed)[1] if topic == "control"]
    assert told == [("stop button", "stopped"), ("stop button", "stop button released")]


@pytest.mark.mission
def test_the_plants_robot_is_driven_by_hand():
    """Half a metre ahead, the hand 10 cm up, the gripper closed; at rest half a second after the keys end."""
    world = open_world("flat")
    simulation = simulate(
        world, {"Alice": only_robot("Alice", world, start=Pose2D(5.2, 4.5, math.pi))}, seed=1, record=False
    )
    robot = simulation.robots["Alice"]
    context = context_for(world, robot, simulation.clock, simulation.starts["Alice"])
    feed = Feed()
    page = TeleopPage(Teleop(context), context, feed)
    page.show_map(world, knowledge_of(world))
    for _ in range(3):
        page.report()
        simulation.clock.advance(0.2)
    live, messages = live_of(feed)
    assert {each for each in live if each.startswith("camera/")} == {
        f"camera/{n}" for n in ("hand", "frontleft", "frontright")
    }
    assert live["teleop"]["base"][:2] == pytest.approx([5.2, 4.5], abs=0.05)
    assert {"map", "pose", "state", "navigation"} <= {topic for topic, _ in messages}
    hands, model = Teleop(context), arm_model(robot.capabilities())
    speeds, rates = [], []

    def hold(asked, done, limit_s=10.0):
        until_s = context.clock.now() + limit_s
        while not done():
            assert context.clock.now() < until_s, f"{asked}: {hands.note}"
            hands.ask(asked)
            one_period()
        for _ in range(5):
            one_period()

    def one_period():
        advance(hands, context)
        speeds.append(np.abs(robot.odometry().velocity))
        rates.append(max(abs(robot.joints().velocity_rad_s[name]) for name in model.names))

    def hand():
        return model.X_BH(np.array([robot.joints().position_rad[name] for name in model.names]))

    def at_rest():
        speed = float(np.hypot(*robot.odometry().velocity[:2]))
        assert speed < 0.05, speed
        assert rates[-1] < 0.05, rates[-1]
        return True

    start = context.pose()
    hold({"forward": 1.0}, lambda: math.hypot(context.pose().x_m - start.x_m, context.pose().y_m - start.y_m) > 0.5)
    assert at_rest()
    before = hand()
    hold({"hand_z": 1.0}, lambda: hand().translation()[2] > before.translation()[2] + 0.1)
    assert at_rest()
    turned = (before.rotation().inverse() @ hand().rotation()).matrix()
    assert np.abs(RollPitchYaw(turned).vector()).max() < 0.1
    hold({"open": 1.0}, lambda: robot.gripper().opening > 0.5)
    hold({"open": -1.0}, lambda: robot.gripper().opening < 0.05)
    most = np.max(speeds, axis=0)
    assert most[0] < OPTIONS.base.max_speed_m_s * 1.1
    assert max(rates) < OPTIONS.arm.joint_rad_s * 1.25

    with pytest.raises(InputError, match="the lease is held by 'teleop'"):
        context_for(world, robot, simulation.clock, simulation.starts["Alice"])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--robot ''", "is not a name for a robot"),
        ("--start 500 500 0", "stands in an obstacle or outside"),
        ("--world nowhere", "unknown world 'nowhere'"),
    ],
)
def test_bad_input_is_refused_in_one_line(words, message, tmp_path, monkeypatch):
    refused_in_one_line({"input": f"teleop {words}", "message": message}, tmp_path, monkeypatch)
