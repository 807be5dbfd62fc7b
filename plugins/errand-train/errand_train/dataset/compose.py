"""Composition of a scene: a room, objects of the classes and distractors on supports and floor, and people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from scipy.spatial import ConvexHull

from errand_train.dataset.objects import CLASSES, DISTRACTORS, ObjectModel, instance, numbers
from errand_train.dataset.resting import choose_pose, resting_poses
from errand_train.dataset.room import Room, Support, random_room
from plant.worlds.seeding import polygon_distance
from skills.robot import FloatArray

SELDOM_BY_CHANCE = ("person", "extinguisher")
"""Classes that stand apart from the clutter, and so are seldom in the views of other objects."""
CLASSES_PER_SCENE = 7
CROWDED_SHARE, MOST_ROUNDS = 0.65, 4
ONLY_DISTRACTORS_EVERY = 10
ATTEMPTS = 30
CLEAR_M = 0.004
LARGE_M = 0.45
HELD_LONGEST_M = 0.40
OTHERS_SHARE = 0.4
"""Share of the distractors that are replaced by models of other people, where the caller gives some."""
TOGETHER_SHARE, SPREAD_M = 0.6, 0.22


@dataclass(frozen=True)
class Placed:
    """An object in the room; `X_WO` is its pose. Distractors have class id 0."""

    model: ObjectModel
    X_WO: RigidTransform


@dataclass(frozen=True)
class Held:
    """An object between the robot's jaws: its pose in the hand's frame, and the opening of the jaw (rad)."""

    model: ObjectModel
    X_HO: RigidTransform


@dataclass(frozen=True)
class Scene:
    """A scene before light and cameras. `seats` are boxes under people who sit: (x, y, yaw, height).

    A `crowded` scene has more objects than those for validation.
    """

    room: Room
    objects: tuple[Placed, ...]
    held: Held | None
    seats: tuple[tuple[float, float, float, float], ...]
    crowded: bool = False


def compose(rng: np.random.Generator, index: int, *, for_training: bool, others: Sequence[ObjectModel] = ()) -> Scene:
    """Composes the scene of a number. Every tenth holds distractors only; `others` replace some of them for training.

    Many scenes for training hold two to four times as many objects as those for validation, so that a picture teaches
    more.
    """
    room = random_room(rng, for_training=for_training)
    bare = index % ONLY_DISTRACTORS_EVERY == ONLY_DISTRACTORS_EVERY - 1
    rounds = int(rng.integers(2, MOST_ROUNDS + 1)) if for_training and rng.random() < CROWDED_SHARE else 1
    wanted = [] if bare else _class_models(rng, rounds, for_training=for_training)
    names = [str(name) for name in rng.choice(DISTRACTORS, int(rng.integers(6, 16)) * rounds)]
    distractors = [_any_instance(rng, name, for_training) for name in names]
    if for_training and others:
        number = len(others)
        distractors = [
            others[int(rng.integers(number))] if rng.random() < OTHERS_SHARE else model for model in distractors
        ]
    table = _Table(room, rng, toppled=for_training)
    crowded = list(rng.permutation(len(room.supports)))[: int(rng.integers(2, 5))] if room.supports else []
    for model in [*wanted, *distractors]:
        table.place(model, [room.supports[k] for k in crowded])
    held = None
    if rng.random() < 0.3:
        held = _hold(rng, distractors[0] if bare else None, for_training=for_training)
    return Scene(room, tuple(table.objects), held, tuple(table.seats), rounds > 1)


def _class_models(rng: np.random.Generator, rounds: int, *, for_training: bool) -> list[ObjectModel]:
    """Instances of some classes, sometimes two of one, with the small ones in several rounds; large ones first."""
    chosen = [str(name) for name in rng.permutation(CLASSES)[:CLASSES_PER_SCENE]]
    doubled = [name for name in chosen if name not in SELDOM_BY_CHANCE and rng.random() < 0.35]
    again = [name for name in CLASSES if name not in SELDOM_BY_CHANCE] * (rounds - 1)
    models = [_any_instance(rng, name, for_training) for name in [*chosen, *doubled, *again]]
    return sorted(models, key=lambda model: model.category != "person")


def _any_instance(rng: np.random.Generator, category: str, for_training: bool) -> ObjectModel:
    return instance(category, int(rng.choice(numbers(category, for_training=for_training))))


def _hold(rng: np.random.Generator, other: ObjectModel | None, *, for_training: bool) -> Held | None:
    """An object that fits between the jaws, its long side across them."""
    categories = [name for name in CLASSES if name not in SELDOM_BY_CHANCE]
    model = other or _any_instance(rng, str(rng.choice(categories)), for_training)
    size = np.array(model.size_m)
    if size.max() > HELD_LONGEST_M or np.sort(size)[0] > 0.09:
        return None
    order = np.argsort(size)
    R = np.zeros((3, 3))
    R[1, order[2]], R[0, order[1]], R[2, order[0]] = 1.0, 1.0, 1.0
    R[0] *= np.sign(np.linalg.det(R))
    spin = RollPitchYaw(rng.normal(0, 0.2), rng.normal(0, 0.2), rng.normal(0, 0.5)).ToRotationMatrix().matrix()
    place = np.array([0.205, float(rng.normal(0, 0.02)), -0.035 + float(size.min()) / 2])
    return Held(model, RigidTransform(RotationMatrix.ProjectToRotationMatrix(spin @ R), place))


class _Table:
    """Placement of objects on supports and floor."""

    def __init__(self, room: Room, rng: np.random.Generator, *, toppled: bool) -> None:
        self._room, self._rng, self._toppled = room, rng, toppled
        self._taken: list[tuple[float, FloatArray]] = []
        self.objects: list[Placed] = []
        self.seats: list[tuple[float, float, float, float]] = []

    def place(self, model: ObjectModel, supports: Sequence[Support]) -> None:
        """Puts an object on a support or on the floor; leaves it out when it fits nowhere."""
        pose = choose_pose(self._rng, model, resting_poses(model), toppled=self._toppled)
        points = model.surface.points @ pose.R.T
        outline = points[ConvexHull(points[:, :2]).vertices, :2]
        tall = float(np.ptp(points[:, 2]))
        for _ in range(4 * ATTEMPTS if model.category == "person" else ATTEMPTS):
            spot = self._spot(model, supports, outline, tall)
            if spot is None:
                continue
            x, y, z, yaw = spot
            turned = outline @ _turn(yaw).T + [x, y]
            if any(abs(z - other) < 0.25 and polygon_distance(turned, o) < CLEAR_M for other, o in self._taken):
                continue
            self._add(model, pose.R, pose.height_m, (x, y, z, yaw), turned)
            return

    def _spot(
        self, model: ObjectModel, supports: Sequence[Support], outline: FloatArray, tall: float
    ) -> tuple[float, float, float, float] | None:
        """Tries a place (x, y, z, yaw) on a support or the floor; None when it is taken."""
        rng, yaw = self._rng, float(self._rng.uniform(0, 2 * np.pi))
        on_floor = 1.0 if model.category == "person" else 0.75 if max(model.size_m) > LARGE_M else 0.2
        if model.category == "extinguisher":
            on_floor = 0.7
        if not supports or rng.random() < on_floor:
            return self._floor_spot(outline, tall, yaw)
        support = supports[min(int(rng.geometric(0.45)) - 1, len(supports) - 1)]
        if tall > support.room_m:
            return None
        reach = np.linalg.norm(outline, axis=1).max() * float(rng.choice([1.0, 0.6]))
        half = np.maximum(np.array(support.half) - reach, 0.0)
        if not half.all() and reach > 1.5 * min(support.half):
            return None
        local = rng.uniform(-1, 1, 2) * half
        near = self._neighbour(support.height_m)
        if near is not None:
            wished = _turn(-support.yaw_rad) @ (near + rng.normal(0, SPREAD_M, 2) - support.centre)
            local = np.clip(wished, -half, half) if np.all(np.abs(wished) < np.array(support.half) + 0.3) else local
        x, y = np.array(support.centre) + _turn(support.yaw_rad) @ local
        return (float(x), float(y), support.height_m, yaw)

    def _neighbour(self, height_m: float) -> FloatArray | None:
        """Chooses sometimes an object on the same level to stand beside, since clutter gathers."""
        level = [outline for z, outline in self._taken if abs(z - height_m) < 0.01]
        if not level or self._rng.random() > TOGETHER_SHARE:
            return None
        return np.asarray(level[int(self._rng.integers(len(level)))].mean(axis=0))

    def _floor_spot(self, outline: FloatArray, tall: float, yaw: float) -> tuple[float, float, float, float] | None:
        width, depth, _ = self._room.size_m
        x, y = float(self._rng.uniform(0.1, width - 0.1)), float(self._rng.uniform(0.1, depth - 0.1))
        near = self._neighbour(0.0)
        if near is not None:
            x, y = (float(v) for v in near + self._rng.normal(0, 2 * SPREAD_M, 2))
        turned = outline @ _turn(yaw).T + [x, y]
        low, high = turned.min(axis=0), turned.max(axis=0)
        if low.min() < 0.03 or high[0] > width - 0.03 or high[1] > depth - 0.03:
            return None
        for o in self._room.obstacles:
            if o.low[2] < tall and np.all(low < o.high[:2]) and np.all(high > o.low[:2]):
                return None
        return (x, y, 0.0, yaw)

    def _add(
        self,
        model: ObjectModel,
        R: FloatArray,
        height: float,
        spot: tuple[float, float, float, float],
        outline: FloatArray,
    ) -> None:
        x, y, z, yaw = spot
        whole = np.eye(3)
        whole[:2, :2] = _turn(yaw)
        turn = RotationMatrix.ProjectToRotationMatrix(whole @ R)
        self.objects.append(Placed(model, RigidTransform(turn, [x, y, z + height])))
        self._taken.append((z, outline))
        if model.kind == "sitting":
            self.seats.append((x, y, yaw, float(np.clip(_seat_height(model), 0.3, 0.6))))


def _seat_height(model: ObjectModel) -> float:
    """Height of a sitting person's thighs: the lowest point behind the hips."""
    points = model.surface.points
    behind = points[
        (points[:, 0] < 0.05) & (points[:, 0] > -0.15) & (points[:, 2] > 0.25) & (np.abs(points[:, 1]) < 0.15)
    ]
    return float(behind[:, 2].min()) if len(behind) else 0.45


def _turn(angle: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])
