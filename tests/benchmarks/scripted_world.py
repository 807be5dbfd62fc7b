"""A small world that scripted skills act on, its history for the referee, and what a person would say of a run."""

import math
import random
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from executive.run.mission_history import is_speech
from executive.words.goal import GoalKind, When
from executive.words.knowledge import ANYBODY, Knowledge
from executive.words.outlines import inside
from plant.referee.judge import DOOR_LOOK_S, judge
from plant.referee.object_history import ObjectHistory, ObjectSample, TimedPath, Truth, extend_path, extend_stays
from skills.api import Cause, Failed, ObjectKind, ObjectObservation, Succeeded
from tests.executive.conftest import KNOWLEDGE, VirtualClock

SAMPLES = 5
NEAR_PERSON_M = 2.0
HAND, FLOOR = "hand", "floor"
NEAR_DOCK_M = 0.1
DOOR_W = (2.5, 0.0)
DOOR_STAYS_S = 17.0
"""The door is open for so long, then closed for so long, and so on."""
PEOPLE = {"Sam": (0.5, 4.5), "Robin": (0.5, 0.5)}
OBJECTS = {
    "coke": ("coke", "counter"),
    "coke_2": ("coke", "shelf"),
    "beer": ("beer", "counter"),
    "beer_2": ("beer", "shelf"),
    "hammer": ("hammer", "bedside table"),
}


def _square(x, y, dx, dy):
    return [[x - dx, y - dy], [x + dx, y - dy], [x + dx, y + dy], [x - dx, y + dy]]


_PLACES = {
    "kitchen": _square(4.5, 0.0, 1.5, 2.0),
    "bedroom": _square(-4.5, 0.0, 1.5, 2.0),
    "hall": _square(0.0, 0.0, 2.0, 2.0),
    "bathroom": _square(0.5, 4.0, 1.0, 1.0),
}
_SURFACES = {
    "shelf": _square(5.5, 1.5, 0.5, 0.5),
    "counter": _square(5.5, -1.5, 0.5, 0.5),
    "bedside table": _square(-5.5, 1.5, 0.5, 0.5),
}
WORLD = Knowledge.model_validate(
    {
        **KNOWLEDGE,
        "places": {name: {**facts, "polygon": _PLACES[name]} for name, facts in KNOWLEDGE["places"].items()},
        "surfaces": {name: {**facts, "polygon": _SURFACES[name]} for name, facts in KNOWLEDGE["surfaces"].items()},
        "doors": [{"between": ["hall", "kitchen"], "at": DOOR_W, "width": 1.0}],
    }
)


@dataclass(frozen=True)
class Moved:
    """An object came from one place to another; `robot`: a robot did it."""

    t_s: float
    name: str
    before: str
    after: str
    robot: bool = True


def door_is_open(t_s):
    return int(t_s / DOOR_STAYS_S) % 2 == 0


@dataclass
class ScriptedWorld:
    """Where the robot and the objects are. Skills that `lie` claim what they have not done; with `accidents`, what was
    put down falls.

    Objects are on a surface, on the floor, in the hand, or with a person.
    """

    rng: random.Random
    lying: float = 0.0
    accidents: float = 0.0
    robot_W: tuple[float, float] = (0.0, 0.0)
    places: dict[str, str] = field(default_factory=lambda: {name: place for name, (_, place) in OBJECTS.items()})
    moves: list[Moved] = field(default_factory=list)
    drives: list[tuple[float, tuple[float, float]]] = field(default_factory=list)
    said: list[tuple[float, str]] = field(default_factory=list)
    lies: list[tuple[float, str]] = field(default_factory=list)
    histories: dict[str, ObjectHistory] = field(
        default_factory=lambda: {name: ObjectHistory(name, class_name) for name, (class_name, _) in OBJECTS.items()}
    )
    path: list[Any] = field(default_factory=list)
    given: dict[tuple[str, str], list[tuple[float, float]]] = field(default_factory=dict)

    def lie(self, now_s, what):
        lies = self.rng.random() < self.lying
        if lies:
            self.lies.append((now_s, what))
        return lies

    def move(self, now_s, name, after, *, robot=True):
        self.moves.append(Moved(now_s, name, self.places[name], after, robot))
        self.places[name] = after

    def held(self):
        return next((name for name, place in self.places.items() if place == HAND), None)

    def navigate(self, now_s, inputs):
        if not self.lie(now_s, "navigate"):
            self.drive_to(now_s, (inputs.goal.x_m, inputs.goal.y_m))
        return Succeeded("there")

    def drive_to(self, now_s, place_W):
        self.robot_W = place_W
        self.drives.append((now_s, self.robot_W))
        extend_path(self.path, np.array([*self.robot_W, 0.5]), now_s)

    def detect(self, now_s, inputs):
        on = [surface.name for surface in inputs.surfaces]
        seen = [name for name, place in self.places.items() if place in on and OBJECTS[name][0] in inputs.classes]
        found = [self.observation(now_s, name) for name in seen]
        if self.lie(now_s, "detect"):
            x, y, z = self.on_surface(next(iter(OBJECTS)), on[0]) if on[0] in _SURFACES else (0.0, 0.0, 0.0)
            kind = ObjectKind(inputs.classes[0])
            found = [] if seen else [ObjectObservation(now_s, kind, (x, y + 0.07, z), (0.06,) * 3, 0.0, 0.9)]
        return _seen(found, "not seen")

    def find_people(self, now_s, inputs):
        wanted = None if inputs.person in (ANYBODY, "person") else inputs.person
        there = [p for name, p in PEOPLE.items() if wanted in (None, name) and inside(inputs.area_W, p)]
        there = [p for p in there if all(math.dist(p, one.position_W[:2]) > 0.9 for one in inputs.avoid)]
        if self.lie(now_s, "find_people"):
            there = [] if there else [(0.0, 0.0)]
        return _seen([_person(now_s, p) for p in there], "nobody is there")

    def meet_person(self, now_s, inputs):
        if not any(math.dist(p, inputs.place_W) < 1.0 for p in PEOPLE.values()):
            return Failed(Cause.POSTCONDITION, "nobody is there")
        self.drive_to(now_s, inputs.place_W)
        return Succeeded("beside them", {"person": _person(now_s, inputs.place_W, inputs.place)})

    def charge(self, now_s, inputs):
        dock = WORLD.dock
        if dock is None or math.dist(self.robot_W, (dock.x, dock.y)) > NEAR_DOCK_M:
            return Failed(Cause.PRECONDITION, "the robot is not at the dock")
        return Succeeded("charged")

    def check_door(self, now_s, inputs):
        return Succeeded("seen", {"open": door_is_open(now_s) is not self.lie(now_s, "check_door")})

    def grasp(self, now_s, inputs):
        at = np.array(inputs.observation.position_W)
        near = [name for name in self.places if float(np.linalg.norm(self.position(name) - at)) < 0.03]
        if self.held() is not None or not near:
            return Failed(Cause.POSTCONDITION, "nothing was taken")
        if not self.lie(now_s, "grasp"):
            self.move(now_s, near[0], HAND)
        return Succeeded("held", {"tried": (*inputs.avoid, 1)})

    def place(self, now_s, inputs):
        return self._let_go(now_s, inputs.surface.name, "place")

    def hand_over(self, now_s, inputs):
        nearest = min(PEOPLE, key=lambda each: math.dist(PEOPLE[each], self.robot_W))
        return self._let_go(now_s, inputs.person if inputs.person in PEOPLE else nearest, "hand_over")

    def _let_go(self, now_s, after, what):
        """Lets go of what is in the hand; a lie drops it."""
        name, lies = self.held(), self.lie(now_s, what)
        if name is not None:
            self.move(now_s, name, FLOOR if lies else after)
        return Succeeded("let go")

    def approach(self, now_s, inputs):
        return Succeeded("near", {"observation": inputs.observation})

    def says(self, now_s, text):
        """Says something; True unless that is a lie."""
        if self.lie(now_s, "speak"):
            return False
        self.said.append((round(now_s, 6), text))
        return True

    def on_surface(self, name, surface):
        number, polygon = list(OBJECTS).index(name), _SURFACES[surface]
        x, y = np.mean(polygon, axis=0)
        return float(x), float(y) + 0.15 * (number - 2), WORLD.surfaces[surface].height + 0.06

    def position(self, name, place=None):
        place = self.places[name] if place is None else place
        if place == HAND:
            return np.array([*self.robot_W, 1.5])
        if place == FLOOR:
            return np.array([9.0, float(list(OBJECTS).index(name)), 0.05])
        if place in PEOPLE:
            return np.array([*PEOPLE[place], 1.1])
        return np.array(self.on_surface(name, place))

    def observation(self, now_s, name):
        x, y, z = map(float, self.position(name))
        thing, place = ObjectKind(OBJECTS[name][0]), self.places[name]
        return ObjectObservation(now_s, thing, (x, y, z), (0.06, 0.06, 0.12), 0.0, 0.9, place)

    def accident(self, now_s):
        """Something that a robot put down may fall."""
        put = [move.name for move in self.moves if move.robot and self.places[move.name] in _SURFACES]
        if put and self.rng.random() < self.accidents:
            self.lies.append((now_s, "fall"))
            self.move(now_s, self.rng.choice(put), FLOOR, robot=False)

    def sample(self, now_s):
        for name, history in self.histories.items():
            place, p_W = self.places[name], self.position(name)
            held = place == HAND
            history.add(
                ObjectSample(
                    time_s=now_s,
                    p_WO=p_W,
                    gripper="Alice" if held else None,
                    X_WH=RigidTransform(p_W) if held else None,
                    supported=not held,
                    on_floor=place == FLOOR,
                    tray_of=place if place in PEOPLE else None,
                )
            )
            if history.on_tray_of is not None:
                extend_stays(self.given.setdefault((name, history.on_tray_of), []), now_s)
        extend_path(self.path, np.array([*self.robot_W, 0.5]), now_s)

    def judge(self, conditions, now_s):
        people = {name: TimedPath(np.array([[*p_W, 0.9, 0.0]])) for name, p_W in PEOPLE.items()}
        robots = {"Alice": TimedPath(np.array(self.path))}
        changes = [(n * DOOR_STAYS_S, 0.0 if n % 2 == 0 else 1.0) for n in range(int(now_s / DOOR_STAYS_S) + 1)]
        doors = {DOOR_W: changes}
        truth = Truth(now_s, tuple(self.histories.values()), robots, people, self.given, doors)
        return judge(conditions, truth, collisions=())


def _seen(observations, otherwise):
    if not observations:
        return Failed(Cause.POSTCONDITION, otherwise)
    return Succeeded("seen", {"observation": observations[0], "observations": tuple(observations), "unexplained": ()})


def _person(now_s, p_W, place=None):
    return ObjectObservation(now_s, ObjectKind("person"), (*p_W, 0.9), (0.5, 0.5, 1.7), 0.0, 0.9, place)


class Clock(VirtualClock):
    def __init__(self, world):
        super().__init__()
        self.world, self.over = world, False
        world.sample(0.0)

    def advance(self, dt_s):
        begun_s = self.now()
        if not self.over:
            self.world.accident(begun_s)
        for number in range(1, SAMPLES + 1):
            self.world.sample(begun_s + number * dt_s / SAMPLES)
        super().advance(dt_s)


def expected(tree, result, transitions, world):
    """What a person would say of a mission that claims success, who has seen the world and the log of the tree.

    True: all that was done and counts was so when it was to be so. None: there is nothing to judge by.
    """
    seen = _Onlooker(tree, transitions, world)
    found = [holds for part in tree.parts for holds in seen.of(part, result)]
    found += [holds for node in tree.root.walk() if is_speech(node) for holds in seen.speech(node.path_id)]
    return all(found) if found else None


class _Onlooker:
    def __init__(self, tree, transitions, world):
        self.world = world
        self.logged = {}
        for each in transitions:
            self.logged.setdefault(str(each["node"]), []).append((float(each["t"]), str(each["to"])))
        self.above = {tree.root.path_id: ()}
        for node in tree.root.walk():
            for child in node.children:
                self.above[child.path_id] = (*self.above[node.path_id], node.path_id)

    def times(self, path):
        """When something was done that counts: nothing around it failed or was broken off while it was done."""
        begun_s = None
        for t_s, to in self.logged.get(path, ()):
            if to == "RUNNING":
                begun_s = t_s
            elif to == "SUCCESS" and all(self._went_well(above, t_s) for above in self.above[path]):
                yield (t_s if begun_s is None else begun_s), t_s

    def _went_well(self, path, t_s):
        ends = (to for when_s, to in self.logged.get(path, ()) if when_s >= t_s and to != "RUNNING")
        return next(ends, "SUCCESS") == "SUCCESS"

    def of(self, part, result):
        """Whether what a part was to bring about was so, each time."""
        goal = part.goal
        if goal is None or goal.when is When.ALWAYS:
            return
        if goal.kind in (GoalKind.ANSWERED, GoalKind.DOOR_OPEN):
            for finding in result.findings:
                if f"{finding.path_id}/".startswith(f"{part.path_id}/"):
                    yield finding.answer in self.answers(goal, finding.t_s)
            return
        for begun_s, ended_s in self.times(part.node or part.path_id):
            yield self.done(goal, begun_s, ended_s)

    def answers(self, goal, t_s):
        if goal.kind is GoalKind.DOOR_OPEN:
            closed = goal.wanted == "closed"
            return {door_is_open(max(0.0, t_s - DOOR_LOOK_S)) != closed, door_is_open(t_s) != closed}
        return {self.count(goal, t_s) >= max(1, goal.count)}

    def done(self, goal, begun_s, ended_s):
        needed = max(1, goal.count)
        if goal.kind in (GoalKind.WENT, GoalKind.MET):
            x, y = self.robot_at(ended_s)
            if goal.person is not None:
                return math.dist((x, y), PEOPLE[goal.person]) <= NEAR_PERSON_M
            return any(inside(region.polygon_W, (x, y)) for region in goal.goal)
        mine = [move for move in self.world.moves if move.robot and self.fits(goal, move.name)]
        if goal.kind is GoalKind.GRASPED:
            sources = {region.name for region in goal.source}
            since_s = begun_s if goal.when is When.SOME_TIME else -1.0
            taken = [
                m.name for m in mine if m.after == HAND and m.before in sources and since_s <= m.t_s <= ended_s + 0.01
            ]
            held = [name for name in taken if goal.when is When.SOME_TIME or self.place_at(name, ended_s) == HAND]
            return len(set(held)) >= needed
        goals = {region.name for region in goal.goal}
        if goal.kind is GoalKind.HANDED_OVER:
            goals = {goal.person} if goal.person is not None else set(PEOPLE)
        put = [m for m in mine if m.after in goals and begun_s <= m.t_s <= ended_s + 0.01]
        there = [m for m in put if self.place_at(m.name, ended_s) == m.after and self.stayed(m, ended_s)]
        return len({m.name for m in there}) >= needed

    def stayed(self, put, since_s):
        after = [move for move in self.world.moves if move.name == put.name and move.t_s > put.t_s]
        return not after or after[0].robot

    def speech(self, path):
        for begun_s, ended_s in self.times(path):
            first_s = begun_s - 0.01 if begun_s == ended_s else begun_s + 0.01  # what was said before ended as it began
            yield any(first_s <= t_s <= ended_s + 0.01 for t_s, _ in self.world.said)

    def count(self, goal, t_s):
        if goal.classes == (ANYBODY,):
            people = [p for name, p in PEOPLE.items() if goal.person in (None, name)]
            return sum(any(inside(region.polygon_W, p) for region in goal.source) for p in people)
        places = {region.name for region in goal.source}
        return sum(self.fits(goal, name) and self.place_at(name, t_s) in places for name in OBJECTS)

    def fits(self, goal, name):
        return not goal.classes or OBJECTS[name][0] in goal.classes

    def place_at(self, name, t_s):
        before = [move.after for move in self.world.moves if move.name == name and move.t_s <= t_s + 1e-6]
        return before[-1] if before else OBJECTS[name][1]

    def robot_at(self, t_s):
        before = [p_W for when_s, p_W in self.world.drives if when_s <= t_s + 1e-6]
        return before[-1] if before else (0.0, 0.0)
