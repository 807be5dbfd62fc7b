"""The detect skill: look at surfaces with the hand camera until a thing of some class is found, and look twice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from pydrake.math import RigidTransform

from skills.api import Cause, ObjectObservation, Running, Succeeded, Surface
from skills.arm.arm_skill import ArmSkill, hand_camera_in_hand
from skills.arm.collision import ArmScene
from skills.arm.poses import look_configuration, overview_stations
from skills.arm.routine import Routine, SkillFailure
from skills.detect.appearance import load_appearance
from skills.detect.interim_segmentation import Sighting, SurfaceView, observation, sightings, view_surface
from skills.detect.looking import look_targets, surface_boxes
from skills.detect.messages import detections_message, object_destination_message, object_to_detect_message
from skills.robot import FloatArray, Image

SEGMENTATION_LATENCY_S = 0.15
_CONFIRM_SHIFT_RAD = 0.14
_CONFIRM_DISTANCE_M = 0.08
_EXPECTED_WITHIN_M = 0.35


@dataclass(frozen=True)
class DetectInputs:
    """What to look for (any of `classes`, with all `attributes`) and on which surfaces.

    With `expected_W` only that place is looked at, and only what is within 0.35 m of it counts.
    """

    classes: tuple[str, ...]
    surfaces: tuple[Surface, ...]
    attributes: tuple[str, ...] = ()
    expected_W: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Look:
    """One picture and the sightings in it, the surest first."""

    image: Image
    X_WO: RigidTransform
    views: tuple[SurfaceView, ...]
    sightings: tuple[Sighting, ...]


class Detect(ArmSkill[DetectInputs]):
    """Looks from where the robot stands; the arm stays raised on success and is stowed when nothing was found."""

    name = "detect"
    Inputs = DetectInputs
    outputs: ClassVar[Mapping[str, type]] = {"observation": ObjectObservation}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "a class, attribute or surface cannot be looked for from here, or there is no arm",
        Cause.PLANNING: "the arm finds no pose to look from",
        Cause.EXECUTION: "the arm did not get to where it looks from",
        Cause.POSTCONDITION: "no such thing is seen",
    }
    default_timeout_s = 90.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"observation": 3.0}

    def run(self, inputs: DetectInputs) -> Routine[Succeeded]:
        """Look at each surface in turn; a sighting counts when a second look from beside agrees."""
        self._check(inputs)
        self.context.publish("object_to_detect", object_to_detect_message(self.context, inputs.classes))
        X_WB = self.X_WB()
        self.boxes = surface_boxes(inputs.surfaces, X_WB)
        targets = self._targets(inputs, X_WB)
        if not targets:
            raise SkillFailure(Cause.PRECONDITION, f"{_names(inputs)} is out of sight from here")
        X_HC = hand_camera_in_hand((yield from self.picture("looking")))
        for k, target in enumerate(targets):
            found = yield from self._look_and_confirm(inputs, X_HC, target)
            if found is not None:
                return Succeeded(f"saw {_describe(found)}", {"observation": found})
            yield Running(f"looking for {_wanted(inputs)}", (k + 1) / len(targets))
        yield from self.try_stow()
        raise SkillFailure(Cause.POSTCONDITION, f"no {_wanted(inputs)} seen on {_names(inputs)} from here")

    def _targets(self, inputs: DetectInputs, X_WB: RigidTransform) -> list[FloatArray]:
        """Points p_BT to look at, one after the other."""
        if inputs.expected_W is not None:
            return [X_WB.inverse() @ np.array(inputs.expected_W)]
        return [t for s in _by_distance(inputs.surfaces, X_WB) for t in look_targets(s, X_WB, self.model.p_BS)]

    def _check(self, inputs: DetectInputs) -> None:
        """Raise SkillFailure with cause PRECONDITION for what cannot be looked for."""
        appearance = load_appearance()
        unknown = [name for name in inputs.classes if name not in appearance.classes]
        unknown += [word for word in inputs.attributes if word not in appearance.attributes]
        if unknown:
            raise SkillFailure(Cause.PRECONDITION, f"I do not know what {', '.join(unknown)} looks like")
        if not inputs.surfaces:
            raise SkillFailure(Cause.PRECONDITION, "there is no surface to look at")
        assert self.model is not None

    def _look_and_confirm(
        self, inputs: DetectInputs, X_HC: RigidTransform, p_BT: FloatArray
    ) -> Routine[ObjectObservation | None]:
        first = yield from self.look(inputs, X_HC, p_BT, 0.0)
        for sighting in _expected(first.sightings, inputs.expected_W)[:2]:
            seen = observation(sighting, first.image.stamp_s, inputs.attributes)
            p_BO = self.X_WB().inverse() @ np.array(seen.position_W)
            second = yield from self.look(inputs, X_HC, p_BO, _CONFIRM_SHIFT_RAD)
            for other in second.sightings:
                again = observation(other, second.image.stamp_s, inputs.attributes)
                if again.thing == seen.thing and _distance(again, seen) < _CONFIRM_DISTANCE_M:
                    message = object_destination_message(self.context, again, second.image, second.X_WO)
                    self.context.publish("object_destination", message)
                    return again
        return None

    def look(self, inputs: DetectInputs, X_HC: RigidTransform, p_BT: FloatArray, shift_rad: float) -> Routine[Look]:
        """Point the camera at p_BT, from a little aside when shift_rad is not 0, and publish what is seen."""
        message = f"looking for {_wanted(inputs)}"

        def goal(scene: ArmScene, q: FloatArray) -> FloatArray:
            return look_configuration(scene, X_HC, overview_stations(self.model, p_BT, shift_rad), p_BT, q)

        yield from self.move_to(goal, message)
        yield from self.clear_view(message)
        image = yield from self.picture(message)
        X_WO = self.context.localiser.estimate().X_WO
        look = yield from self.compute(
            lambda: _examine(inputs, image, X_WO), latency_s=SEGMENTATION_LATENCY_S, name="segment", message=message
        )
        self.context.publish("detections", detections_message(look.image, look.sightings))
        return look


def _examine(inputs: DetectInputs, image: Image, X_WO: RigidTransform) -> Look:
    seen = (view_surface(image, X_WO, surface) for surface in inputs.surfaces)
    views = tuple(view for view in seen if view is not None)
    clusters = tuple(cluster for view in views for cluster in view.clusters)
    found = sightings(clusters, load_appearance(), inputs.classes, inputs.attributes)
    return Look(image, X_WO, views, tuple(found))


def _expected(found: Sequence[Sighting], place_W: tuple[float, float, float] | None) -> list[Sighting]:
    """The sightings near an expected place, the nearest first; all where none is expected."""
    if place_W is None:
        return list(found)
    off = {id(s): float(np.linalg.norm(np.subtract(s.cluster.shape.centre, place_W[:2]))) for s in found}
    return sorted((s for s in found if off[id(s)] < _EXPECTED_WITHIN_M), key=lambda s: off[id(s)])


def _by_distance(surfaces: tuple[Surface, ...], X_WB: RigidTransform) -> list[Surface]:
    here = X_WB.translation()[:2]
    return sorted(surfaces, key=lambda s: float(np.min(np.linalg.norm(np.asarray(s.polygon_W) - here, axis=1))))


def _distance(a: ObjectObservation, b: ObjectObservation) -> float:
    return float(np.linalg.norm(np.subtract(a.position_W, b.position_W)))


def _wanted(inputs: DetectInputs) -> str:
    return " or ".join(" ".join((*inputs.attributes, name)) for name in inputs.classes)


def _names(inputs: DetectInputs) -> str:
    return " or ".join(f"the {surface.name}" for surface in inputs.surfaces)


def _describe(seen: ObjectObservation) -> str:
    x, y, z = seen.position_W
    place = f" on the {seen.surface}" if seen.surface else ""
    return f"a {seen.thing}{place} at ({x:.2f}, {y:.2f}, {z:.2f}), score {seen.score:.2f}"
