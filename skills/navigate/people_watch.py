"""Watching for people by the body cameras that look where the robot goes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from pydrake.math import RigidTransform

from skills.api import Detection, Job, SkillContext
from skills.detect.seeing import seen_in_grey
from skills.estimate.planar import relative
from skills.perception.position import position_of
from skills.robot import FloatArray, Image, Pose2D

__all__ = ["PEOPLE_TOPIC", "PeopleOptions", "PeopleWatch", "SeenPerson", "cameras_towards"]


PEOPLE_TOPIC: Final = "people"
PERSON: Final = "person"
_HEIGHTS_M: Final = (0.2, 0.6, 1.0)
_NEAREST_M: Final = 0.3
_WELL_INSIDE: Final = 0.35
_SAME_PLACE_M: Final = 0.05
_SAME_YAW_RAD: Final = 0.05


@dataclass(frozen=True)
class PeopleOptions:
    """How often is looked (s), how late the answer comes (s), and what counts as a person.

    A person counts once seen twice within `same_m`, at least `least_score` sure; a second look follows the first after
    `again_s`. Who should be in a picture and is not for `misses` times has gone. Who is out of all pictures is
    remembered for `memory_s`, and for `beside_s` as long as the costmap knows something within `beside_m` of the place.
    """

    period_s: float = 0.5
    again_s: float = 0.2
    latency_s: float = 0.15
    least_score: float = 0.5
    reach_m: float = 4.0
    same_m: float = 0.7
    misses: int = 3
    memory_s: float = 2.0
    beside_s: float = 10.0
    beside_m: float = 0.5


@dataclass(frozen=True)
class SeenPerson:
    """Somebody seen: the upright axis (x, y) in the world (m), its covariance (2, 2), when last and how often.

    `here_W` is where the robot was then, and `missed` how many looks since then should have shown them.
    """

    place_W: tuple[float, float]
    covariance: FloatArray
    score: float
    stamp_s: float
    here_W: Pose2D
    looks: int = 1
    missed: int = 0


@dataclass(frozen=True)
class _Look:
    """Who is in the pictures of one moment, and the pictures without their pixels: frames and lenses."""

    found: tuple[SeenPerson, ...]
    images: tuple[Image, ...]
    X_WO: RigidTransform
    here_W: Pose2D

    def shows(self, one: SeenPerson, reach_m: float) -> bool:
        """Whether somebody who has not moved would be seen: from where they were seen before, or well in a picture."""
        off = relative(one.here_W, self.here_W)
        if math.hypot(off.x_m, off.y_m) < _SAME_PLACE_M and abs(off.yaw_rad) < _SAME_YAW_RAD:
            return True
        upright_W = np.array([[*one.place_W, height_m] for height_m in _HEIGHTS_M])
        return any(_inside(image, self.X_WO, upright_W, reach_m) for image in self.images)


class PeopleWatch:
    """Knows who is near while its `step` is called. Idle where the detector knows no people, or without cameras."""

    def __init__(self, context: SkillContext, options: PeopleOptions | None = None) -> None:
        self._context = context
        self._options = options or PeopleOptions()
        knows = PERSON in context.detector.class_names
        self._cameras = context.robot.capabilities().camera_sources if knows else ()
        self._next_s = -math.inf
        self._job: Job[_Look] | None = None
        self._seen: tuple[SeenPerson, ...] = ()

    def people(self) -> tuple[SeenPerson, ...]:
        """Those who count now."""
        return tuple(one for one in self._seen if one.looks > 1 and self._remembered(one))

    def step(self, velocity: FloatArray) -> None:
        """Take in what was seen; look again in time, towards a body-frame velocity (3,). Never blocks."""
        if self._job is not None:
            if self._job.done():
                look, self._job = self._job.result(), None
                self._take(look)
            return
        now_s = self._context.clock.now()
        sources = cameras_towards(velocity, self._cameras)
        if sources and now_s >= self._next_s:
            self._next_s = now_s + self._options.period_s
            X_WO, here_W = self._context.localiser.estimate().X_WO, self._context.pose()
            self._job = self._context.worker.submit(
                lambda: self._look(sources, X_WO, here_W), latency_s=self._options.latency_s, name="look for people"
            )

    def _look(self, sources: Sequence[str], X_WO: RigidTransform, here_W: Pose2D) -> _Look:
        """People in one picture of each camera."""
        images = [self._context.robot.image(source, depth=False) for source in sources]
        found = seen_in_grey(self._context.detector, images)
        pairs = [(image, one) for image, ones in zip(images, found, strict=True) for one in ones]
        seen = [self._placed(image, one, X_WO, here_W) for image, one in pairs]
        return _Look(tuple(one for one in seen if one is not None), tuple(images), X_WO, here_W)

    def _placed(self, image: Image, one: Detection, X_WO: RigidTransform, here_W: Pose2D) -> SeenPerson | None:
        """Where a detected person is; None for other things, and for people out of the reach of depth."""
        if one.class_name != PERSON or one.score < self._options.least_score:
            return None
        depth_m = self._context.robot.image(image.source, visual=False).depth_m
        position = position_of(replace(image, depth_m=depth_m), one)
        if position is None:
            return None
        p_OC = image.frames.pose(image.camera_frame).translation()
        if float(np.hypot(*(position.p_OT - p_OC)[:2])) > self._options.reach_m:
            return None
        x, y, _ = (float(value) for value in X_WO @ position.p_OT)
        turn = X_WO.rotation().matrix()
        covariance = (turn @ position.covariance_O @ turn.T)[:2, :2]
        return SeenPerson((x, y), covariance, one.score, image.stamp_s, here_W)

    def _take(self, look: _Look) -> None:
        """Bring what is known up to date, tell of it, and look again soon when somebody is new."""
        before, stamp_s = self._seen, self._context.clock.now()
        for one in look.found:
            stamp_s = one.stamp_s
            self._seen = merged(self._seen, one, self._options.same_m)
        self._seen = tuple(self._missed(one, look, stamp_s) for one in self._seen)
        self._seen = tuple(one for one in self._seen if self._remembered(one))
        if any(one.looks == 1 for one in self._seen):
            self._next_s = min(self._next_s, self._context.clock.now() + self._options.again_s)
        if look.found or before:
            self._context.publish(PEOPLE_TOPIC, self._message())

    def _missed(self, one: SeenPerson, look: _Look, stamp_s: float) -> SeenPerson:
        """Somebody after a look, which counts as a miss when it should have shown them and did not."""
        due = one.stamp_s < stamp_s and look.shows(one, self._options.reach_m)
        return replace(one, missed=one.missed + 1) if due else one

    def _remembered(self, one: SeenPerson) -> bool:
        """Whether somebody is still to be reckoned with."""
        options = self._options
        age_s = self._context.clock.now() - one.stamp_s
        if one.missed >= options.misses or age_s > options.beside_s:
            return False
        if age_s <= options.memory_s or one.missed > 0:
            return True
        return float(self._context.costmap.clearance_m(np.array([one.place_W]))[0]) < options.beside_m

    def _message(self) -> dict[str, object]:
        return {
            "stamp": self._context.clock.now(),
            "robot": self._context.robot.name,
            "people": [
                {
                    "position_W": [round(value, 3) for value in one.place_W],
                    "covariance": [round(float(value), 5) for value in one.covariance.ravel()],
                    "score": round(one.score, 3),
                    "looks": one.looks,
                }
                for one in self._seen
            ],
        }


def _inside(image: Image, X_WO: RigidTransform, points_W: FloatArray, reach_m: float) -> bool:
    """Whether any of some points (N, 3) lies well inside a picture, within reach of its camera."""
    p_C = (X_WO @ image.frames.pose(image.camera_frame)).inverse().multiply(points_W.T)
    lens, z = image.intrinsics, np.maximum(p_C[2], 1e-6)
    u, v = p_C[0] / z * lens.fx + lens.cx, p_C[1] / z * lens.fy + lens.cy
    inside = (np.abs(u / lens.width - 0.5) < _WELL_INSIDE) & (np.abs(v / lens.height - 0.5) < _WELL_INSIDE)
    return bool(np.any(inside & (p_C[2] > _NEAREST_M) & (p_C[2] < reach_m)))


def merged(known: Sequence[SeenPerson], new: SeenPerson, same_m: float) -> tuple[SeenPerson, ...]:
    """What is known with somebody seen anew: in the place of the nearest within same_m, or as one more.

    The newer place counts: people walk. Two cameras that see one person at once count as one look.
    """
    near = [one for one in known if math.dist(one.place_W, new.place_W) <= same_m]
    if not near:
        return (*known, new)
    old = min(near, key=lambda one: math.dist(one.place_W, new.place_W))
    again = old.looks + (new.stamp_s > old.stamp_s)
    return tuple(replace(new, looks=again) if one is old else one for one in known)


def cameras_towards(velocity: FloatArray, known: Sequence[str]) -> tuple[str, ...]:
    """The cameras that look where a body-frame velocity leads; those ahead when the robot stands or turns."""
    vx, vy = float(velocity[0]), float(velocity[1])
    sources: tuple[str, ...] = ("frontleft", "frontright")
    if abs(vy) > 2.0 * abs(vx):
        sources = ("left",) if vy > 0.0 else ("right",)
    elif vx < 0.0:
        sources = ("back",)
    return tuple(source for source in sources if source in known)
