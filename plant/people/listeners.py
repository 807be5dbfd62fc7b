"""People who hear robots near them and in sight, and answer from the true state."""

import math
import re
import zlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import numpy as np
from pydrake.systems.framework import Context

from plant.diagram import WorldDiagram
from plant.events import Doors
from plant.people.ground import Ground
from plant.people.walkers import HEARS_M, segments_cross
from plant.worlds.seeding import Placement
from plant.worlds.world import Point

EYES_M: Final = (1.2, 1.8)
"""Shapes between these heights hide people from robots that speak."""
FACES_RAD: Final = 1.0
"""A robot faces the people whose bearing is not more to either side."""
BESIDE_M: Final = 0.4
_WHO: Final = re.compile(r"\bare you (?P<name>[^?,.]+)\?", re.IGNORECASE)
_STREAM: Final = 14


class Listeners:
    """The people of one plant as listeners."""

    def __init__(
        self, world: WorldDiagram, context: Context, doors: Doors, people: Iterable[Placement], *, seed: int
    ) -> None:
        """`context` is the plant's; `seed` draws the answers that the people have not been given."""
        self._world, self._context, self._doors, self._seed = world, context, doors, seed
        self._answers = {each.name: each.answers for each in people}
        plant, models = world.plant, world.models
        self._bodies = {name: plant.get_body(plant.GetBodyIndices(models[name])[0]) for name in self._answers}
        self._walls: Ground | None = None

    def hearer(self, robot: str) -> str | None:
        """Returns the nearest person in earshot and in sight, preferably ahead of the robot; None without any."""
        world = self._world
        X_WR = world.plant.EvalBodyPoseInWorld(self._context, world.robots[robot].body)
        robot_W = float(X_WR.translation()[0]), float(X_WR.translation()[1])
        places_W = {name: self._place_W(body) for name, body in self._bodies.items()}
        away_m = {name: math.dist(place_W, robot_W) for name, place_W in places_W.items()}

        def not_faced(name: str) -> bool:
            x, y, _ = X_WR.inverse() @ np.array([*places_W[name], X_WR.translation()[2]])
            return abs(math.atan2(y, x)) > FACES_RAD

        heard = (name for name in away_m if away_m[name] <= HEARS_M)
        near = sorted(heard, key=lambda name: (not_faced(name), away_m[name]))
        return next((name for name in near if self._in_sight(robot_W, places_W[name])), None)

    def answer(self, person: str, question: str, options: Sequence[str] = ()) -> str | None:
        """Returns a person's answer to a question; None when the person has none.

        The name answers "Are you Robin?". The first of the person's `answers` with a text in the question answers other
        questions. For any other question with options, a person who has answers chooses one by the seed.
        """
        answers: Mapping[str, str] = self._answers[person]
        who = _WHO.search(question)
        if who is not None:
            return "yes" if who["name"].strip().casefold() == person.casefold() else "no"
        given = next((said for part, said in answers.items() if part.casefold() in question.casefold()), None)
        if given is not None or not answers or not options:
            return given
        rng = np.random.default_rng([self._seed, _STREAM, zlib.crc32(f"{person}: {question}".encode())])
        return options[int(rng.integers(len(options)))]

    def _in_sight(self, from_W: Point, to_W: Point) -> bool:
        """Returns whether neither a wall nor a closed door is between a robot and a person."""
        world = self._world
        if self._walls is None:
            inspector, corners = world.scene_graph.model_inspector(), (from_W, to_W)
            self._walls = Ground.from_plant(world.plant, inspector, corners, EYES_M)
        share = max(0.0, 1.0 - BESIDE_M / max(math.dist(from_W, to_W), BESIDE_M))
        beside_W = (from_W[0] + share * (to_W[0] - from_W[0]), from_W[1] + share * (to_W[1] - from_W[1]))
        door = any(segments_cross((from_W, to_W), each) for each in self._doors.barriers)
        return not door and self._walls.sees(from_W, beside_W)

    def _place_W(self, body: object) -> Point:
        x, y, _ = self._world.plant.EvalBodyPoseInWorld(self._context, body).translation()
        return float(x), float(y)
