"""A fleet's run with scripted robots: who does what, and what becomes of the mission of a robot that dies."""

import json
import re
import signal
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from executive.app.fleet.auction import Bid
from executive.app.fleet.dispatch import Dispatch, limit_of
from executive.app.fleet.fleet_mission import FleetMission, FleetRobot, Offers, missions_json
from executive.app.fleet.fleet_run import TIME_LIMIT_S, run_fleet
from executive.app.prepare.from_request import prepare
from executive.app.prepare.prepared import Prepared
from executive.app.runs.backend import LiveLog
from executive.app.runs.page_view import PageView
from executive.cli import entry
from executive.cli.fleet_command import _to_do, resumable_lines
from executive.mission.request import Request
from executive.record.history import read_events
from executive.run.visitor import RunEntry
from executive.store.missions import GivenMissions, MissionStore
from executive.tree.compiler import compile_mission
from executive.words.command import Command, parse_command
from executive.words.leaf_steps import Do, steps_of_commands
from executive.words.mission import Mission
from executive.words.steps import lines_of_steps
from executive.words.task import task_named
from plant.robots.robot_kind import PlacedRobot
from skills.api import Cause, Failed, Running, Skill, Succeeded
from skills.inputs.errors import InputError
from skills.robot import Pose2D
from tests.benchmarks.fleet import begun_again
from tests.executive.conftest import COKE, default_end
from tests.tables import yaml_beside

KITCHEN = "Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"
BEDROOM = "Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]"
TAKE = "Take [Nothing] to [kitchen] and do [grasp] to [coke]"
PUT = "Take [coke] to [bedroom] and do [Nothing] to [Nothing]"
ON_TABLE = "Take [coke] to [shelf] and do [Nothing] to [Nothing]"
START = Pose2D(0.0, 0.0, 0.0)
ROBOTS = ("Alice", "Bob")


def work(*lines):
    return Request(commands=lines, name="work", world_name="scripted")


@dataclass(frozen=True)
class ScriptedMission(Prepared):
    """A mission of scripted skills."""

    registry: Mapping[str, type[Skill]] = field(default_factory=dict)

    def with_mission(self, mission):
        known = {"knowledge": self.knowledge, "last_known": self.last_known}
        tree = compile_mission(mission, registry=self.registry, **known)
        return replace(
            self, request=replace(self.request, commands=lines_of_steps(tree.steps)), mission=mission, tree=tree
        )


class ScriptedOffers(Offers):
    """What the scripted robots offer, as a test says."""

    def __init__(self, fleet, *of):
        super().__init__(*of, bid=fleet.bid)
        self.takes_from = fleet.takes_from


class Fleet:
    """Scripted robots with a store, an auction in which Alice is a little faster, and faults by robot."""

    def __init__(self, store, clock, knowledge, registry, make, script, out):
        self.script = script
        self.store, self.clock, self.registry, self.out = store, clock, registry, out
        battery = knowledge.battery.model_copy(update={"low": 0.05})
        self.knowledge = knowledge.model_copy(update={"battery": battery})
        self.unable, self.cannot = set(), lambda name, command: False
        self.robots = {name: make.StandingRobot(clock, name) for name in ROBOTS}
        self.faults, self.make, self.missions, self.judged = {}, make, {}, []
        self.shares, self.since_s, self.ended = [], [], []
        self.tables, self.slower_s = None, 0.5

    def entry(self, tree, durable):
        return RunEntry(tree, self.robots[tree.robot_name], self.make.StillLocaliser(), self.make.EmptyCostmap())

    def bid(self, mission, now, low):
        name = now.placed.name
        prepared = mission.options.get(name)
        commands = () if prepared is None else prepared.tree.commands
        unable = name in self.unable or any(self.cannot(name, command) for command in commands)
        problems = ("out of reach",) if unable else ()
        return Bid(mission.stored.id, name, 0.0, 1.0 + self.slower_s * ROBOTS.index(name), problems=problems)

    def takes_from(self, name, table):
        return self.tables is None or table.place in self.tables

    def _prepared(self, request, mission):
        tree = compile_mission(mission, knowledge=self.knowledge, registry=self.registry)
        world = SimpleNamespace(name="scripted", dock=START)
        asked = replace(request, commands=lines_of_steps(tree.steps))
        return ScriptedMission(asked, mission, world, self.knowledge, tree, {}, registry=self.registry)

    def queue(self, *missions):
        """Queues missions, each a line or several."""
        for lines in missions:
            self._add((lines,) if isinstance(lines, str) else lines)

    def _add(self, lines):
        stored = self.store.add(work(*lines), queued=True)
        self.missions[stored.id] = FleetMission(stored, self.prepare(stored.request)[0])

    def prepare(self, request):
        if "[moon]" in request.commands[0]:
            raise InputError("I know no place 'moon'")
        steps = steps_of_commands(tuple(map(parse_command, request.commands)))
        missions = {name: Mission(name="work", robot=name, steps=steps) for name in ROBOTS}
        return {name: self._prepared(request, mission) for name, mission in missions.items()}, 80.0

    def show_live(self):
        return None

    def visitors(self, control, log):
        return ()

    def leave(self, artifacts, out):
        return None

    def judge(self, tree, result, *, before, since_s):
        self.judged.append((tree.robot_name, result.outcome.value))
        self.shares += [(share.tree.robot_name, share.done) for share in before]
        self.since_s.append(since_s)

    def run(self, visitors=(), control=None, time_limit_s=None):
        robots = {name: self._robot(name) for name in ROBOTS}
        missions = {number: replace(mission) for number, mission in self.missions.items()}
        offers = partial(ScriptedOffers, self)
        self.dispatch = dispatch = Dispatch(self.store, missions, robots, self, self.prepare, offers=offers)
        ended = partial(self._note_end, dispatch)
        limits = {"time_limit_s": time_limit_s}
        run_fleet(dispatch, out=self.out, seed=3, visitors=visitors, control=control, ended=ended, **limits)
        self.rows = rows = missions_json(self.store, list(dispatch.missions))
        return [(row["robot"], row["outcome"], row["reassigned"]) for row in rows]

    def _note_end(self, dispatch, total):
        assert total <= len(dispatch.missions)
        self.ended.append(sum(mission.ended is not None for mission in dispatch.missions.values()))

    def _robot(self, name):
        step, placed = Do.from_command(Command(task=task_named("charge"))), PlacedRobot(name, "spot", START)
        dock = self._prepared(Request(), Mission(name="charge", robot=name, steps=(step,)))
        return FleetRobot(placed, START, dock=dock, faults=tuple(self.faults.get(name, ())))

    def hold(self, skill):
        self.robots[skill.context.robot.name].holding = True
        return Succeeded("held", {"tried": (*skill.inputs.avoid, 1)})

    def put_down(self, skill):
        self.robots[skill.context.robot.name].let_go()
        return Succeeded("placed")

    def charge(self, skill):
        self.robots[skill.context.robot.name].charge = 0.9
        return Succeeded("charged")

    def die_once_after(self, name, skill):
        """The way to a place is the last that a robot does when one has done what `name` says."""
        robot = self.robots[skill.context.robot.name]
        if name in self.script.begun and not any(each.raising for each in self.robots.values()):
            robot.raising["odometry"] = ConnectionError("no answer")
            return Running("goes on")
        return Succeeded("there")

    def message(self, number):
        return self.store.mission(number).message


@pytest.fixture
def fleet(tmp_path, clock, knowledge, registry, make, script):
    for name in ("grasp", "place"):
        registry[name].changes_world = True
    with MissionStore(tmp_path / "missions.sqlite") as store:
        fleet = Fleet(store, clock, knowledge, registry, make, script, tmp_path / "out")
        script.ends.update(grasp=fleet.hold, place=fleet.put_down, charge=fleet.charge)
        yield fleet


def test_three_missions_are_done_by_two_robots(fleet, script):
    fleet.queue(KITCHEN, BEDROOM, KITCHEN)
    assert fleet.run() == [("Alice", "success", 0), ("Bob", "success", 0), ("Alice", "success", 0)]
    assert script.begun == ["navigate"] * 3
    assert fleet.ended == [1, 2, 3]
    assert sorted(fleet.judged) == [("Alice", "success"), ("Alice", "success"), ("Bob", "success")]
    assert [robot.holder for robot in fleet.robots.values()] == [None, None]


FLEETS = yaml_beside(__file__, "fleets.yaml")
MISSIONS = {"go bedroom": BEDROOM, "go kitchen": KITCHEN, "take": TAKE, "take and put": (TAKE, PUT)}


@pytest.mark.parametrize("case", FLEETS, ids=lambda case: case["name"])
def test_missions_go_to_the_robots_that_can_do_them(fleet, script, case):
    def detect(skill):
        blind = skill.context.robot.name in case.get("blind", ())
        return Failed(Cause.POSTCONDITION, "no coke was seen") if blind else default_end(script, "detect")(skill)

    script.ends["detect"] = detect
    for name, (cause, message) in {name: said.split(" ", 1) for name, said in case.get("ends", {}).items()}.items():
        script.ends[name] = lambda skill, why=(Cause[cause], message): Failed(*why)
    fleet.faults, fleet.unable = case.get("faults", {}), {case.get("unable")}
    if "low" in case:
        fleet.robots[case["low"]].charge = 0.1
    if "lease" in case:
        fleet.robots[case["lease"]].holder = "the tablet"
    fleet.queue(*(MISSIONS[name] for name in case["missions"]))
    done = [list(row) for row in fleet.run()]
    assert done == case.get("done", done)
    assert [outcome for _, outcome, _ in done] == case.get("outcomes", [outcome for _, outcome, _ in done])
    assert script.begun == case.get("begun", script.begun)
    assert script.begun.count("charge") == case.get("charges", script.begun.count("charge"))
    assert case.get("message", "") in (fleet.message(1) or "")
    holders = {robot.holder for robot in fleet.robots.values()}
    assert "faults" in case or holders == ({None, "the tablet"} if "lease" in case else {None})


def test_commands_that_are_done_are_not_done_again_by_the_other(fleet, script):
    fleet.queue((TAKE, PUT, KITCHEN))
    script.ends["navigate"] = lambda skill: fleet.die_once_after("place", skill)
    assert fleet.run() == [("Bob", "success", 1)]
    assert (script.begun.count("grasp"), script.begun.count("place")) == (1, 1)
    assert (fleet.robots["Alice"].holding, fleet.robots["Bob"].calls.count("drive")) == (False, script.steps)
    assert (fleet.judged, fleet.shares, fleet.since_s) == ([("Bob", "success")], [("Alice", 2)], [0.0])
    assert begun_again(read_events(fleet.out / "log.mcap")) == []


def test_a_command_that_was_begun_again_after_it_was_done_is_found_in_the_log(fleet, script):
    fleet.queue((KITCHEN, BEDROOM))
    fleet.run()
    (event,) = (each for each in read_events(fleet.out / "log.mcap") if _begins_first_command(each))
    events = list(read_events(fleet.out / "log.mcap"))
    last = max(n for n, each in enumerate(events) if each.topic == "transitions" and each.data["to"] == "SUCCESS")
    assert begun_again([*events[:last], event, *events[last:]]) == [f"mission 1: {KITCHEN}"]


def _begins_first_command(event):
    return event.topic == "transitions" and event.data["node"].endswith("/1-kitchen") and event.data["to"] == "RUNNING"


def test_an_object_in_a_dead_robots_gripper_is_named_and_not_fetched_again(fleet, script):
    script.ends["navigate"] = lambda skill: fleet.die_once_after("grasp", skill)
    fleet.queue((TAKE, PUT))
    assert (fleet.run(), script.begun.count("grasp")) == ([("Alice", "error", 0)], 1)
    assert fleet.message(1).endswith("; the coke is in Alice's gripper")


def test_status_shows_what_runs_and_what_waits_while_it_does(fleet, script):
    fleet.queue(KITCHEN, BEDROOM, KITCHEN)
    told_then = []

    def ask(skill):
        told_then.append(CliRunner().invoke(entry.app, ["fleet", "status", str(fleet.store.path), "--json"]))
        return Succeeded("there")

    script.ends["navigate"] = ask
    fleet.run()
    first, *_, last = (json.loads(each.stdout.splitlines()[-1])["missions"] for each in told_then)
    states = [[(row["robot"], row["outcome"]) for row in rows] for rows in (first, last)]
    assert states[0] == [("Alice", "running"), ("Bob", "running"), (None, "queued")]
    assert states[1] == [("Alice", "success"), ("Bob", "success"), ("Alice", "running")]


def test_the_store_has_the_robot_of_each_mission(fleet):
    fleet.queue(KITCHEN)
    fleet.run()
    given = GivenMissions(fleet.store).all()[1]
    assert (given.robot, given.done, given.blocked) == ("Alice", 1, None)


def test_the_log_of_a_fleet_is_sent_live(fleet):
    fleet.queue(KITCHEN)
    followed = []
    fleet.run(visitors=[LiveLog(SimpleNamespace(follow=followed.append))])
    assert [log.path for log in followed] == [fleet.out / "log.mcap"]


def test_each_mission_is_judged_from_its_own_beginning(fleet):
    fleet.queue(KITCHEN, KITCHEN)
    fleet.unable = {"Bob"}
    fleet.run()
    first_s, second_s = fleet.since_s
    assert first_s == 0.0 < second_s


def test_a_robot_that_is_low_puts_down_what_it_holds_before_it_gives_the_rest_back(fleet, script):
    fleet.queue((TAKE, PUT, KITCHEN))

    def hold(skill):
        fleet.robots["Alice"].charge = 0.1
        return fleet.hold(skill)

    script.ends["grasp"] = hold
    assert fleet.run() == [("Bob", "success", 1)]
    assert (script.begun.count("grasp"), script.begun.count("place"), fleet.shares) == (1, 1, [("Alice", 2)])


def test_a_robot_that_is_lost_is_left_out_and_its_mission_done_by_the_other(fleet, script):
    fleet.queue(KITCHEN)
    lost = [True]

    def lose(skill):
        if skill.context.robot.name == "Alice" and lost:
            skill.context.localiser.localised = False
            return Failed(Cause.EXECUTION, "lost")
        return Succeeded("there")

    script.ends["navigate"] = lose
    script.ends["relocalise"] = lambda skill: Failed(Cause.EXECUTION, "no match")
    assert fleet.run() == [("Bob", "success", 1)]


def only_alice_takes_and_only_bob_goes_to_the_bedroom(name, command):
    takes_in_kitchen = command.task is task_named("grasp") and command.goal == "kitchen"
    return (name == "Bob" and takes_in_kitchen) or (name == "Alice" and command.goal == "bedroom")


@pytest.fixture
def chain(fleet, script):
    script.seen_on = {*script.seen_on, "shelf"}  # where the first robot puts it
    fleet.cannot = only_alice_takes_and_only_bob_goes_to_the_bedroom
    fleet.queue((TAKE, PUT))
    return fleet


def test_a_mission_that_no_robot_can_do_alone_is_split_at_a_table(chain, script):
    assert chain.run() == [("Bob", "success", 0), ("Alice", "success", 0), ("Bob", "success", 0)]
    parts = [(row["id"], row["part_of"], row["after"]) for row in chain.rows]
    assert parts == [(1, None, None), (2, 1, None), (3, 1, 2)]
    first, second = (chain.store.mission(number).request.commands for number in (2, 3))
    take = first[1].replace("[coke] to", "[Nothing] to").replace("do [Nothing] to [Nothing]", "do [grasp] to [coke]")
    assert (first[0], second) == (TAKE, (take, PUT))
    assert (script.begun.count("grasp"), script.begun.count("place")) == (2, 2)


def test_a_chain_is_judged_as_a_whole_from_the_beginning_of_its_first_part(chain):
    chain.run()
    assert chain.judged == [("Alice", "success"), ("Bob", "success")]
    assert (chain.shares, chain.since_s) == ([("Alice", 2)], [0.0, 0.0])


def test_the_first_robot_leaves_the_table_to_the_second_and_goes_to_its_dock(chain, script):
    chain.run()
    assert script.begun.count("charge") == 1
    assert [robot.holder for robot in chain.robots.values()] == [None, None]


def test_a_mission_is_not_split_at_a_table_that_the_second_robot_cannot_reach(chain):
    chain.tables = ()
    assert chain.run() == [(None, "failure", 0)]


def test_the_second_part_begins_when_the_first_robot_has_left_the_table(chain, script):
    begun = []

    def charge(skill):
        begun.append(len([each for each in script.begun if each == "grasp"]))
        alice = chain.robots["Alice"]
        if len(begun) < 5:
            return Running("on its way")
        alice.standing = Pose2D(2.0, 0.0, 0.0)
        return Running("far enough") if len(begun) < 400 else chain.charge(skill)

    script.ends["charge"] = charge
    assert [outcome for _, outcome, _ in chain.run()] == ["success"] * 3
    assert (begun[4], begun[-1]) == (1, 2)


def test_when_the_first_part_fails_the_second_is_not_begun(chain, script):
    script.ends["place"] = lambda skill: Failed(Cause.EXECUTION, "slipped")
    assert [outcome for _, outcome, _ in chain.run()] == ["failure"] * 3
    assert chain.message(3) == "mission 2, which comes before it, was not done"
    assert chain.message(1).startswith("mission 2: ")


def test_a_mission_that_no_two_robots_can_do_ends_with_each_reason(chain):
    chain.cannot = lambda name, command: command.goal == "bedroom"
    assert chain.run() == [(None, "failure", 0)]
    assert chain.message(1) == "no robot can do it: Alice: out of reach; Bob: out of reach"


def test_a_mission_for_one_robot_is_not_split(chain):
    chain.cannot = lambda name, command: name == "Alice" and command.goal == "bedroom"
    assert chain.run() == [("Bob", "success", 0)]


def test_the_log_has_the_robot_of_each_mission_whenever_it_changes(fleet):
    fleet.queue(KITCHEN)
    fleet.faults["Alice"] = ["robot dies at 0.08 s"]
    fleet.run()
    events = read_events(fleet.out / "log.mcap")
    told = [event.data["missions"][0] for event in events if event.topic == "missions"]
    states = [(each["robot"], each["outcome"], each["reassigned"]) for each in told]
    assert states == [("Alice", "running", 0), ("Alice", "queued", 0), ("Bob", "running", 1), ("Bob", "success", 1)]
    assert {each["sentence"] for each in told} == {"work"}
    assert {"Alice", "Bob"} <= {event.data.get("robot") for event in events if event.topic == "transitions"}


def test_the_report_has_each_mission_and_the_steps_of_each_robot(fleet):
    fleet.queue(KITCHEN, BEDROOM)
    fleet.run()
    html = (fleet.out / "report.html").read_text(encoding="utf-8")
    assert "2 of 2 missions achieved" in html
    assert [title in html for title in ("Mission 1, Alice (spot): work", "Mission 2, Bob (spot): work")] == [True] * 2
    assert html.count("<svg") == 2


def test_a_mission_that_is_cancelled_on_its_robots_panel_is_over_and_the_robot_goes_on(fleet, script):
    fleet.queue(KITCHEN, BEDROOM, KITCHEN)

    class CancellingPage(PageView):
        def tick(self, progress):
            if progress.ticks == 1:
                self.control.cancel("not now", robot="Bob")

    page = CancellingPage(None, lambda line: None)
    try:
        fleet.run([page], page.control)
    finally:
        page.close()
    assert sorted(row["outcome"] for row in fleet.rows) == ["cancelled", "success", "success"]
    assert fleet.message(2) == "not now"
    assert [robot.holder for robot in fleet.robots.values()] == [None, None]


def test_a_robot_that_gave_up_finding_its_place_is_lost_whatever_it_believes_afterwards(fleet, script):
    fleet.queue(KITCHEN)

    def lose(skill):
        if skill.context.robot.name == "Alice":
            skill.context.localiser.localised = False
            return Running("turning")
        return Succeeded("there")

    def give_up(skill):
        skill.context.localiser.localised = True
        return Failed(Cause.EXECUTION, "no place on the map fits")

    script.ends.update(navigate=lose, relocalise=give_up)
    assert fleet.run() == [("Bob", "success", 1)]


def test_a_dropped_object_is_taken_by_the_other_robot(fleet, script):
    fleet.queue((TAKE, PUT))

    def lose(skill):
        fleet.robots[skill.context.robot.name].let_go()
        return Failed(Cause.EXECUTION, "it slipped")

    script.ends["place"] = lambda skill: (lose if skill.context.robot.name == "Alice" else fleet.put_down)(skill)
    assert fleet.run() == [("Bob", "success", 1)]
    assert fleet.robots["Alice"].holding is fleet.robots["Bob"].holding is False


def looks_of(script, seen_by_alice=COKE):
    """The first surface of each look of Bob, who sees the object at once, and whether the floor beside it counts."""
    looks = []

    def detect(skill):
        if skill.context.robot.name == "Alice":
            seen = default_end(script, "detect")(skill)
            return (
                replace(seen, outputs={"observation": seen_by_alice, "observations": (), "unexplained": ()})
                if script.seen_on
                else seen
            )
        looks.append((skill.inputs.surfaces[0].name, skill.inputs.floor))
        return Succeeded("seen", {"observation": COKE, "observations": (COKE,), "unexplained": ()})

    script.ends.update(detect=detect, approach=lambda skill: Succeeded("near", {"observation": seen_by_alice}))
    return looks


def test_the_other_robot_looks_first_where_the_object_was_seen(fleet, script):
    fleet.queue("Take [Nothing] to [Nothing] and do [grasp] to [coke]")
    looks = looks_of(script, replace(COKE, surface="bedside table"))
    too_wide = Failed(Cause.PLANNING, "too wide")
    script.ends["grasp"] = lambda skill: too_wide if skill.context.robot.name == "Alice" else fleet.hold(skill)
    assert fleet.run() == [("Bob", "success", 1)]
    assert looks[0] == ("bedside table", True)


def test_the_other_robot_looks_first_at_the_floor_where_the_object_fell(fleet, script):
    fleet.queue((TAKE, PUT))
    looks = looks_of(script)
    lost = []

    def lose(skill):
        robot = fleet.robots[skill.context.robot.name]
        if robot.name == "Alice" and robot.holding:
            robot.let_go()
            lost.append(robot)
            script.seen_on = set()
            return Failed(Cause.POSTCONDITION, "it slipped")
        return fleet.put_down(skill)

    script.ends["place"] = lose
    assert fleet.run() == [("Bob", "success", 1)]
    assert lost
    assert looks[0] == ("floor", False)


def test_an_object_that_was_let_go_is_not_placed_by_another_robot(fleet, script):
    fleet.registry["place"].outputs = {"released_W": tuple[float, float, float]}
    fleet.queue((TAKE, PUT))

    def lose(skill):
        fleet.robots[skill.context.robot.name].let_go()
        script.seen_on = set()
        return Failed(Cause.POSTCONDITION, "it is not seen where it was put down", {"released_W": (1.5, 2.0, 0.8)})

    script.ends["place"] = lose
    assert fleet.run() == [("Alice", "failure", 0)]
    assert "; the coke was let go at (1.50, 2.00) m" in fleet.message(1)


def test_a_mission_does_not_wait_for_a_robot_that_is_late(fleet, script):
    fleet.queue(KITCHEN, KITCHEN, KITCHEN)
    fleet.slower_s = 1.5

    def arrive(skill):
        late = skill.context.robot.name == "Alice" and fleet.clock.now() < 20.0
        return Running("does not get on") if late else Succeeded("there")

    script.ends["navigate"] = arrive
    assert [robot for robot, *_ in fleet.run()] == ["Alice", "Bob", "Bob"]


def test_two_robots_do_not_put_things_on_one_surface_at_once(fleet, script):
    fleet.queue((TAKE, ON_TABLE), (TAKE, ON_TABLE), BEDROOM)
    at_work = []

    def put_down(skill):
        at_work.append({row["robot"] for row in missions_json(fleet.store, [1, 2]) if row["outcome"] == "running"})
        return fleet.put_down(skill)

    script.ends["place"] = put_down
    assert [robot for robot, *_ in fleet.run()] == ["Alice", "Alice", "Bob"]
    assert at_work == [{"Alice"}, {"Alice"}]


def interrupted_at(fleet, skill_ends):
    """A Ctrl-C while a skill runs."""

    def interrupt(skill):
        if not fleet.interrupted:
            fleet.interrupted = True
            signal.raise_signal(signal.SIGINT)
            return Running("on its way")
        return skill_ends(skill)

    fleet.interrupted = False
    return interrupt


def test_after_ctrl_c_the_next_run_goes_on_with_what_was_under_way(fleet, script):
    fleet.queue(KITCHEN, BEDROOM, KITCHEN)
    script.ends["navigate"] = interrupted_at(fleet, lambda skill: Succeeded("there"))
    assert [outcome for _, outcome, _ in fleet.run()] == ["queued", "success", "queued"]
    assert resumable_lines(fleet.store, fleet.out) == [
        f"2 missions are left in the queue; `errand fleet run {fleet.out}` with the same options goes on."
    ]
    assert [each.id for each in _to_do(fleet.store)] == [1, 3]
    del fleet.missions[2]
    assert [outcome for _, outcome, _ in fleet.run()] == ["success"] * 2


def test_after_ctrl_c_with_something_in_the_gripper_the_mission_is_cancelled_and_can_be_resumed(fleet, script):
    fleet.queue((TAKE, PUT))
    at_goal = interrupted_at(fleet, lambda skill: Succeeded("there"))
    script.ends["navigate"] = lambda skill: at_goal(skill) if "grasp" in script.begun else Succeeded("there")
    assert fleet.run() == [("Alice", "cancelled", 0)]
    assert fleet.message(1) == "cancelled by SIGINT; the coke is in Alice's gripper"
    with pytest.raises(InputError, match=r"no mission is queued; .*errand resume --mission 1 --store"):
        _to_do(fleet.store)


@pytest.fixture
def answers(fleet, script):
    """Answers to the missions of `lines`, which another thread adds, one in each drive of a robot."""
    fleet.lines, said = [], []

    def add(line):
        try:
            said.append(fleet.dispatch.add(work(line)))
        except InputError as error:
            said.append(str(error))

    def drive(skill):
        if fleet.lines:
            with ThreadPoolExecutor(1) as page:
                page.submit(add, fleet.lines.pop(0))
        return Succeeded("there")

    script.ends["navigate"] = drive
    return said


def test_a_mission_that_is_added_during_the_run_goes_to_the_robot_that_is_free_first(fleet, answers):
    fleet.queue(KITCHEN, BEDROOM)
    fleet.lines = [KITCHEN]
    assert fleet.run() == [("Alice", "success", 0), ("Bob", "success", 0), ("Alice", "success", 0)]
    assert answers == ["Mission 3 is queued: work"]
    assert "3 of 3 missions achieved" in (fleet.out / "report.html").read_text(encoding="utf-8")
    (*_, told) = (event.data["missions"] for event in read_events(fleet.out / "log.mcap") if event.topic == "missions")
    assert [each["outcome"] for each in told] == ["success"] * 3


def test_a_mission_that_no_robot_understands_is_refused_and_not_stored(fleet, answers):
    fleet.queue(KITCHEN)
    fleet.lines = [KITCHEN.replace("kitchen", "moon")]
    assert fleet.run() == [("Alice", "success", 0)]
    assert answers == ["I know no place 'moon'"]
    assert len(fleet.store.missions()) == 1


def test_a_mission_that_the_time_limit_would_end_is_refused(fleet, answers):
    fleet.queue(KITCHEN, KITCHEN, KITCHEN)
    fleet.lines = [BEDROOM, BEDROOM]
    fleet.run(time_limit_s=60.0)
    (why,) = {re.sub(r"in \d+ s", "in N s", each) for each in answers[-1:]}
    assert why.startswith("the time limit ends the run in N s, and it takes about 80 s")
    assert len(fleet.store.missions()) == 3


def test_each_added_mission_extends_a_time_limit_that_nobody_has_set(fleet, answers):
    fleet.queue(KITCHEN)
    fleet.lines = [BEDROOM, KITCHEN]
    assert len(fleet.run()) == 3
    assert fleet.dispatch.more_s == 2 * TIME_LIMIT_S


def test_the_waits_of_a_mission_lengthen_the_time_limit_of_its_fleet():
    asked = Request(sentence="wait for 50 minutes and go to the kitchen", world="flat")
    alone = prepare(replace(asked, sentence="go to the kitchen"))
    assert limit_of({"Alice": alone, "Bob": prepare(asked)}) == TIME_LIMIT_S + 3000.0


def test_nothing_is_added_to_a_fleet_that_has_ended(fleet):
    fleet.queue(KITCHEN)
    fleet.run()
    with pytest.raises(InputError, match="the fleet has ended its last mission; `errand queue add`"):
        fleet.dispatch.add(work(BEDROOM))
    assert len(fleet.store.missions()) == 1


def test_a_mission_that_is_added_while_the_run_is_cancelled_stays_in_the_queue(fleet, script):
    fleet.queue(KITCHEN)
    script.ends["navigate"] = lambda skill: Running("on its way")

    class CancellingPage(PageView):
        def tick(self, progress):
            self.control.cancel("not now")

        def mission_ended(self, end):
            fleet.dispatch.add(work(BEDROOM))

    page = CancellingPage(None, lambda line: None)
    try:
        outcomes = [outcome for _, outcome, _ in fleet.run([page], page.control)]
    finally:
        page.close()
    assert outcomes == ["cancelled", "queued"]
