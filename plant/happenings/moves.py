"""Objects that somebody puts elsewhere, at their times: from one step to the next, where nobody can see a hand."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final

import numpy as np
import shapely
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from plant.kept import Kept
from plant.worlds.seeding import ATTEMPTS, Placement, candidates, outline_W, polygon_distance
from plant.worlds.world import MoveRule, Point, SurfaceTop, World
from skills.robot import FloatArray

FROM_HAND_M: Final = 0.25
"""Nothing is put nearer than this to a robot's hand, or taken from where it holds something."""
_STREAM: Final = 5

Hands = Mapping[str, FloatArray]
"""Where the hand of each robot is, (3,) in the world."""


class Moves(Kept, keeps=("_done",)):
    """The moves of one plant; `before_step` is to be called before each step."""

    def __init__(
        self,
        plant: MultibodyPlant,
        context: Context,
        world: World,
        placed: Sequence[Placement],
        *,
        seed: int,
        tell: Callable[[str], None],
    ) -> None:
        """`placed` are the loose objects; `tell` takes one sentence for each move, or for one that cannot be."""
        self._plant, self._context, self._world, self._seed, self._tell = plant, context, world, seed, tell
        self._forms = {each.name: each.form for each in placed}
        self._bodies = {
            name: plant.get_body(plant.GetBodyIndices(plant.GetModelInstanceByName(name))[0]) for name in self._forms
        }
        self._done: frozenset[int] = frozenset()
        self._listeners: list[Callable[[str], None]] = []

    def listen(self, listener: Callable[[str], None]) -> None:
        """Calls `listener` with the name of each object that was moved."""
        self._listeners.append(listener)

    def before_step(self, now_s: float, hands_W: Callable[[], Hands], holding: Sequence[str]) -> None:
        """Moves what is due. `hands_W` gives where the robots' hands are; `holding` are those that hold something."""
        for number, move in enumerate(self._world.moves):
            if number not in self._done and now_s >= move.at:
                self._done |= {number}
                self._do(number, move, hands_W(), holding)

    def _do(self, number: int, move: MoveRule, hands_W: Hands, holding: Sequence[str]) -> None:
        here_W = self._place_W(move.name)
        holder = next((name for name in holding if float(np.linalg.norm(hands_W[name] - here_W)) < FROM_HAND_M), None)
        if holder is not None:
            self._tell(f"nobody moves the {move.name}, which {holder} holds")
            return
        X_WO = self._goal(number, move, hands_W)
        if X_WO is None:
            self._tell(f"nobody moves the {move.name}, since nothing is free on the {move.to}")
            return
        body = self._bodies[move.name]
        self._plant.SetFreeBodyPose(self._context, body, X_WO)
        self._plant.SetFreeBodySpatialVelocity(
            context=self._context, body=body, V_JpJc=SpatialVelocity(np.zeros(3), np.zeros(3))
        )
        self._tell(f"somebody moves the {move.name} to {_told(move)}")
        for listener in self._listeners:
            listener(move.name)

    def _goal(self, number: int, move: MoveRule, hands_W: Hands) -> RigidTransform | None:
        """Where the object is put; None where the surface has no free spot."""
        form, rules = self._forms[move.name], self._world.seed_rules.rules
        if not isinstance(move.to, str):
            x, y, z = move.to
            return RigidTransform(np.array([x, y, z + form.rest_height_m + rules.drop_m]))
        surface = self._world.surfaces[move.to]
        rng = np.random.default_rng([self._seed, _STREAM, number])
        taken = [*self._outlines_W(move.name), *(np.array(polygon) for polygon in self._world.seed_rules.keep_clear)]
        inner = shapely.Polygon(surface.polygon_W).buffer(-rules.rim_m)
        for centre, yaw in self._candidates(surface, rng):
            outline = outline_W(form, centre, yaw)
            far = all(float(np.hypot(*(p_W[:2] - centre))) > FROM_HAND_M for p_W in hands_W.values())
            clear = far and all(polygon_distance(outline, other) >= max(rules.clear_m, 0.02) for other in taken)
            if clear and inner.covers(shapely.Polygon(outline)):
                z = surface.height_m + form.rest_height_m + rules.drop_m
                return RigidTransform(RollPitchYaw(0.0, 0.0, yaw), np.array([*centre, z]))
        return None

    def _candidates(self, surface: SurfaceTop, rng: np.random.Generator) -> Iterator[tuple[Point, float]]:
        """Random centres and yaws: along the fronts of a surface that has some, else anywhere on it."""
        if self._world.seed_rules.fronts.get(surface.name):
            yield from candidates(self._world, surface, rng)
            return
        low, high = np.min(surface.polygon_W, axis=0), np.max(surface.polygon_W, axis=0)
        for _ in range(ATTEMPTS):
            x, y = rng.uniform(low, high)
            yield (float(x), float(y)), float(rng.uniform(-np.pi, np.pi))

    def _outlines_W(self, without: str) -> Iterator[FloatArray]:
        """The outlines of the other objects from above, as they stand now."""
        for name, body in self._bodies.items():
            if name != without:
                X_WO = self._plant.EvalBodyPoseInWorld(self._context, body)
                x, y, _ = X_WO.translation()
                yield outline_W(self._forms[name], (float(x), float(y)), RollPitchYaw(X_WO.rotation()).yaw_angle())

    def _place_W(self, name: str) -> FloatArray:
        return np.array(self._plant.EvalBodyPoseInWorld(self._context, self._bodies[name]).translation())


def _told(move: MoveRule) -> str:
    return f"the {move.to}" if isinstance(move.to, str) else "({:g}, {:g}, {:g})".format(*move.to)
