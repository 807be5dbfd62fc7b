"""The detect skill: look at surfaces with the hand camera until an object is found, and look twice."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from pydrake.math import RigidTransform

from skills.api import (
    FLOOR,
    Cause,
    Detection,
    LocalisationEstimate,
    ObjectKind,
    ObjectObservation,
    Running,
    Succeeded,
    Surface,
)
from skills.detect.messages import (
    coverage_message,
    detections_message,
    object_destination_message,
    object_to_detect_message,
    tracks_message,
)
from skills.detect.ports import DetectInputs, DetectPorts
from skills.detect.unidentified import most_free_first, segments_3d, unnamed
from skills.detect.viewpoints import in_plain_view, look_targets, surface_boxes
from skills.detect.words import counted, describe, surface_names, wanted
from skills.geometry import wrap
from skills.manipulation.arm.looking_skill import LookingSkill
from skills.manipulation.arm.poses import close_viewpoints, overview_viewpoints, viewpoints_beside
from skills.perception.attributes import known_attributes, shows
from skills.perception.class_forms import THING, class_forms
from skills.perception.coverage import Coverage
from skills.perception.detection_3d import Detection3D, detections_3d, observation
from skills.perception.detector.camera_images import DETECTION_LATENCY_S, detections_in, is_dark
from skills.perception.surface_segmentation import Cluster, view_surfaces
from skills.perception.tracker import FAINT_SCORE, SURE_SCORE, Track, Tracker
from skills.quantities import Angle, Duration, Length, Tries
from skills.robot import FloatArray, Image
from skills.routine import Routine, SkillFailure

_LEAST_SEEN = 0.02
_FITS_NEAR_M = 0.4
_LOOKED_AT_M = 0.08
_AVOIDED_M = 0.08
_BELOW_TOP_M = 0.01
_RAISED_M = 0.15
"""A head looks once more from a body that is higher by so much."""


@dataclass(frozen=True)
class Look:
    """One picture, where the robot was, what was found in it, with and without a place, and what stands there.

    What was found may be faint.
    """

    image: Image
    localisation: LocalisationEstimate
    detections: tuple[Detection, ...]
    detections_3d: tuple[Detection3D, ...]
    clusters: tuple[Cluster, ...]


@dataclass(frozen=True)
class DetectOptions:
    """How long the skill looks on.

    What may be meant is looked at again from aside, turned by `confirm_shifts_rad` about the shoulder; `candidates` of
    them more than are asked for. What has no name yet is looked at from near, `closer_looks` at most; what something
    hides is looked at from `around_rad`. An answer rests on a picture no older than `fresh_s`. An object counts within
    `expected_within_m` of where it is expected, and on the floor within `floor_within_m` of the robot.
    """

    confirm_shifts_rad: tuple[Angle, ...] = (0.25, -0.3)
    candidates: Tries = 3
    expected_within_m: Length = 0.35
    floor_within_m: Length = 2.2
    closer_looks: Tries = 3
    fresh_s: Duration = 1.5
    around_rad: tuple[Angle, ...] = (0.7, -0.7)


class Detect(DetectPorts, LookingSkill[DetectInputs]):
    """The skill that `DetectPorts` declares."""

    Options: ClassVar[type] = DetectOptions
    options: DetectOptions

    def run(self, inputs: DetectInputs) -> Routine[Succeeded]:
        """Looks at each surface in turn; an object counts when a second look from beside agrees."""
        self._check(inputs)
        self.context.publish("object_to_detect", object_to_detect_message(self.context, inputs.classes))
        X_WB = self.X_WB()
        self.boxes = surface_boxes(inputs.surfaces, X_WB)
        targets = self._targets(inputs, X_WB)
        if not targets:
            raise SkillFailure(Cause.PRECONDITION, f"{surface_names(inputs.surfaces)} is out of sight from here")
        self._tracker, self._coverage = Tracker(self.context.detector.class_names), Coverage(inputs.surfaces)
        self._tried: dict[int, int] = {}
        self._clusters: list[Cluster] = []
        blocked: list[SkillFailure] = []
        targets_W = [X_WB @ p_BT for p_BT in targets]
        for k, p_WT in enumerate(targets_W):
            p_BT = self.X_WB().inverse() @ p_WT
            yield from self._look_and_confirm(inputs, p_BT, blocked, close=_fits_near(inputs))
            if self._has_enough(inputs):
                break
            yield Running(f"looking for {wanted(inputs.classes, inputs.attributes)}", (k + 1) / len(targets))
        yield from self._look_closer(inputs)
        yield from self._look_around(inputs)
        yield from self._look_from_above(inputs, targets_W)
        yield from self._refresh(inputs)
        self.context.publish("surfaces_seen", coverage_message(self.context, self._coverage.shares()))
        return (yield from self._ended(inputs, blocked if len(blocked) == len(targets) else []))

    def _check(self, inputs: DetectInputs) -> None:
        """Raises SkillFailure with cause PRECONDITION for what cannot be looked for."""
        knows = set(self.context.detector.class_names) & set(class_forms()) | {THING}
        unknown = [name for name in inputs.classes if name not in knows]
        unknown += [word for word in inputs.attributes if word.lower() not in known_attributes()]
        if unknown:
            raise SkillFailure(Cause.PRECONDITION, f"I do not know what {', '.join(unknown)} looks like")
        if not inputs.surfaces:
            raise SkillFailure(Cause.PRECONDITION, "there is no surface to look at")
        assert self.model is not None

    def _targets(self, inputs: DetectInputs, X_WB: RigidTransform) -> list[FloatArray]:
        """Points p_BT to look at, one after the other."""
        if inputs.expected_W is not None:
            return [X_WB.inverse() @ np.array(inputs.expected_W)]
        return [t for s in _by_distance(inputs.surfaces, X_WB) for t in look_targets(s, X_WB, self.model.p_BS)]

    def _has_enough(self, inputs: DetectInputs) -> bool:
        return 0 < inputs.count <= len(self._found(inputs))

    def _look_closer(self, inputs: DetectInputs) -> Routine[None]:
        """Looks from near where the object is expected, or at what was not named and may be what is wanted.

        What was looked at from near already is looked at from above.
        """
        if inputs.expected_W is not None:
            if not self._has_enough(inputs):
                p_BT = self.X_WB().inverse() @ np.array(inputs.expected_W)
                yield from self._look_and_confirm(inputs, p_BT, [], close=not _fits_near(inputs))
            return
        if THING in inputs.classes:
            return
        for _ in range(self.options.closer_looks):
            left = unnamed(self._clusters, self._tracker.snapshot(), inputs.classes)
            if self._has_enough(inputs) or not left:
                return
            shape, base_m = left[0].shape, left[0].base_m
            self._clusters = [c for c in self._clusters if _apart(c.shape.centre, shape.centre) > _LOOKED_AT_M]
            p_BT = self.X_WB().inverse() @ np.array([*shape.centre, base_m + 0.5 * shape.height_m])
            kept, self._clusters = self._clusters, []
            yield from self._look_and_confirm(inputs, p_BT, [], close=True)
            self._clusters = kept

    def _look_around(self, inputs: DetectInputs) -> Routine[None]:
        """Looks from either side at what something hides; a camera on a head has no other side."""
        around = inputs.expected_W is None and self.object_camera.on_hand
        for p_W in self._coverage.hidden_middle_W().values() if around else ():
            for shift_rad in self.options.around_rad:
                if self._has_enough(inputs):
                    return
                p_BT = self.X_WB().inverse() @ p_W
                yield from self._look_and_confirm(inputs, p_BT, [], shift_rad=shift_rad)

    def _look_from_above(self, inputs: DetectInputs, targets_W: Sequence[FloatArray]) -> Routine[None]:
        """Looks from a body that stands as high as it can, where the camera is on a head: it looks flat over tables.

        It stays there when that shows what is looked for, which may not be seen from lower down.
        """
        capabilities = self.context.robot.capabilities()
        raised_m = capabilities.height_range_m[1] - capabilities.standing_height_m - _BELOW_TOP_M
        if self.object_camera.on_hand or raised_m < _RAISED_M or self._has_enough(inputs):
            return
        for p_WT in targets_W:
            p_BT = self.X_WB().inverse() @ p_WT
            yield from self._look_and_confirm(inputs, p_BT, [], raised_m=raised_m)
            if self._has_enough(inputs):
                return
        yield from self.stand_as_usual()

    def _refresh(self, inputs: DetectInputs) -> Routine[None]:
        """Looks once more at what was seen last, when that is a while ago: an answer rests on fresh pictures."""
        if (track := self._seen_a_while_ago(inputs)) is not None:
            yield from self._look_and_confirm(inputs, self.X_WB().inverse() @ track.position_W, [])
        if (track := self._seen_a_while_ago(inputs)) is not None:  # from there it did not show: from where it did
            X_BW = self.X_WB().inverse()
            p_BO, eye_B = X_BW @ track.position_W, X_BW @ np.array(track.eyes_W[-1])
            viewpoints = [*viewpoints_beside(self.model.p_BS, eye_B, p_BO), *self._viewpoints(p_BO)]
            yield from self._look_if_possible(inputs, p_BO, viewpoints)

    def _seen_a_while_ago(self, inputs: DetectInputs) -> Track | None:
        """What was found and seen last, unless it was seen just now."""
        newest = next(iter(self._found(inputs)), None)
        return (
            newest
            if newest is not None and self.context.clock.now() - newest.last_seen_s > self.options.fresh_s
            else None
        )

    def _look_and_confirm(
        self,
        inputs: DetectInputs,
        p_BT: FloatArray,
        blocked: list[SkillFailure],
        *,
        close: bool = False,
        shift_rad: float = 0.0,
        raised_m: float = 0.0,
    ) -> Routine[None]:
        """Looks at a point, and again from aside at what may be meant. A look that the arm cannot take is noted."""
        viewpoints = self._viewpoints(p_BT, shift_rad, close=close)
        failure = yield from self._look_if_possible(inputs, p_BT, viewpoints, raised_m)
        if failure is not None:
            blocked.append(failure)
            return
        while (track := self._candidate(inputs)) is not None:
            tries = self._tried[track.number] = self._tried.get(track.number, 0) + 1
            p_BO = self.X_WB().inverse() @ track.position_W
            other_m = _RAISED_M * (tries % 3)
            other_m = raised_m - other_m if raised_m > 0.0 else other_m
            yield from self._look_if_possible(inputs, p_BO, self._confirming(track, tries, close=close), other_m)

    def _look_if_possible(
        self, inputs: DetectInputs, p_BT: FloatArray, viewpoints_B: Sequence[FloatArray], raised_m: float = 0.0
    ) -> Routine[SkillFailure | None]:
        """Looks at a point, unless the arm cannot: then why."""
        try:
            yield from self.look(inputs, p_BT, viewpoints_B, raised_m)
        except SkillFailure as failure:
            if failure.cause is not Cause.PLANNING:
                raise
            return failure
        return None

    def _viewpoints(self, p_BT: FloatArray, shift_rad: float = 0.0, *, close: bool = False) -> list[FloatArray]:
        """Camera places p_BC to look from at p_BT, turned by shift_rad about the shoulder; near ones first if close."""
        far = overview_viewpoints(self.model, p_BT, shift_rad)
        if abs(shift_rad) >= max(map(abs, self.options.around_rad)):
            far = sorted(far, key=lambda p_BC: -float(np.linalg.norm((p_BC - self.model.p_BS)[:2])))
        return [*close_viewpoints(self.model.p_BS, p_BT, shift_rad), *far] if close else far

    def _confirming(self, track: Track, tries: int, *, close: bool) -> list[FloatArray]:
        """Camera places to look from at a track for the first, second or third time after it was seen.

        First from the side farther from where it was seen, then from the other, then from right beside there.
        """
        X_BW = self.X_WB().inverse()
        p_BO, eye_B = X_BW @ track.position_W, X_BW @ np.array(track.eyes_W[-1])
        if tries > len(self.options.confirm_shifts_rad):
            return [*viewpoints_beside(self.model.p_BS, eye_B, p_BO), *self._viewpoints(p_BO)]
        seen_rad, bearing = _bearing(eye_B - self.model.p_BS), _bearing(p_BO - self.model.p_BS)
        off = {shift: abs(wrap(bearing + shift - seen_rad)) for shift in self.options.confirm_shifts_rad}
        shifts_rad = sorted(self.options.confirm_shifts_rad, key=lambda shift: -off[shift])
        return self._viewpoints(p_BO, shifts_rad[tries - 1], close=close)

    def _candidate(self, inputs: DetectInputs) -> Track | None:
        """The likeliest track that may be what is looked for and is to be looked at again."""
        if self._has_enough(inputs) or len(self._tried) > self.options.candidates + inputs.count:
            return None
        shifts = len(self.options.confirm_shifts_rad)
        open_ones = (t for t in self._matching(inputs) if not _is_sure(inputs, t))
        return next((t for t in open_ones if self._tried.get(t.number, 0) < _tries_for(t, shifts)), None)

    def _found(self, inputs: DetectInputs) -> list[Track]:
        """The confirmed ones, those seen last first; of any objects, those first that are to be taken first."""
        confirmed = [track for track in self._matching(inputs) if _is_sure(inputs, track)]
        if inputs.expected_W is not None or THING in inputs.classes:
            return confirmed
        return sorted(confirmed, key=lambda track: -track.last_seen_s)

    def _matching(self, inputs: DetectInputs) -> list[Track]:
        """The tracks that are of the classes, show the attributes and lie in the right place; the likeliest first.

        Of any objects, the nearest and most free ones first.
        """
        tracks = [t for t in self._tracker.snapshot() if _is_wanted(inputs, t) and self._in_place(inputs, t)]
        fitting = [t for t in tracks if all(shows(t.best, word) for word in inputs.attributes)]
        if inputs.expected_W is None and THING in inputs.classes:
            free = most_free_first(fitting, self.X_WB().translation())
            places = [np.array(each.position_W) for each in inputs.avoid]
            return sorted(free, key=lambda t: any(_apart(t.position_W, p) < _AVOIDED_M for p in places))
        if inputs.expected_W is None:
            return sorted(fitting, key=lambda t: -t.belief * t.best.detection.score)
        off = {t.number: _apart(t.position_W, inputs.expected_W) for t in fitting}
        return sorted(
            (t for t in fitting if off[t.number] < self.options.expected_within_m), key=lambda t: off[t.number]
        )

    def _in_place(self, inputs: DetectInputs, track: Track) -> bool:
        if track.latest.surface in {surface.name for surface in inputs.surfaces}:
            return True
        near = _apart(track.position_W, self.X_WB().translation()) < self.options.floor_within_m
        return inputs.floor and track.latest.surface == FLOOR and near

    def look(
        self,
        inputs: DetectInputs,
        p_BT: FloatArray,
        viewpoints_B: Sequence[FloatArray],
        raised_m: float = 0.0,
    ) -> Routine[Look]:
        """Points the camera at p_BT, from the first possible one of `viewpoints_B`, and takes in what is seen.

        One on a head looks from a body that is raised by so much.
        """
        message = f"looking for {wanted(inputs.classes, inputs.attributes)}"
        yield from self.look_at(p_BT, viewpoints_B, message, raised_m=raised_m)
        image = yield from self.picture(message)
        place, detector = self.context.localiser.estimate(), self.context.detector

        def examine() -> Look:
            found = detections_in(detector, image, FAINT_SCORE)
            placed = detections_3d(image, place, found, inputs.surfaces)
            views = [view for view in view_surfaces(image, place.X_WO, inputs.surfaces) if view is not None]
            if THING in inputs.classes:
                placed += segments_3d(image, place, views, placed, inputs.surfaces)
            return Look(image, place, found, placed, tuple(each for view in views for each in view.clusters))

        look = yield from self.compute(examine, latency_s=DETECTION_LATENCY_S, name="detect", message=message)
        self._take_in(look)
        return look

    def _take_in(self, look: Look) -> None:
        X_WO = look.localisation.X_WO
        if not is_dark(look.image):
            self._coverage.add(look.image, X_WO)
        tracks = self._tracker.update(look.detections_3d, lambda t: in_plain_view(look.image, X_WO, t.position_W))
        sure = [detection for detection in look.detections if detection.score >= SURE_SCORE]
        self.context.publish("detections", detections_message(look.image, sure, look.detections_3d))
        self.context.publish("tracks", tracks_message(self.context, tracks))
        self._clusters += look.clusters
        self._last = look

    def _ended(self, inputs: DetectInputs, blocked: Sequence[SkillFailure]) -> Routine[Succeeded]:
        """The answer. Raises SkillFailure when there is none, or not enough."""
        found = [_observed(track, inputs.attributes) for track in self._answered(inputs)]
        if found and len(found) >= inputs.count:
            look = self._last
            for seen in found:
                message = object_destination_message(self.context, seen, look.image, look.localisation.X_WO)
                self.context.publish("object_destination", message)
            told = f"saw {describe(found[0])}" if inputs.count == 1 else counted(found, inputs.surfaces)
            return Succeeded(told, {"observation": found[0], "observations": tuple(found)})
        yield from self.try_stow()
        if blocked:
            raise blocked[0]
        raise self._nothing(inputs, found)

    def _answered(self, inputs: DetectInputs) -> list[Track]:
        """The confirmed ones; of any objects, those first that were seen just now, since an answer rests on that."""
        now_s, found = self.context.clock.now(), self._found(inputs)
        if inputs.expected_W is not None or THING not in inputs.classes:
            return found
        return sorted(found, key=lambda track: now_s - track.last_seen_s > self.options.fresh_s)

    def _nothing(self, inputs: DetectInputs, found: Sequence[ObjectObservation]) -> SkillFailure:
        """What to say when not enough was found: how much was seen of which surface."""
        shares = self._coverage.shares()
        what, names = wanted(inputs.classes, inputs.attributes), surface_names(inputs.surfaces)
        seen = "; ".join(f"{name}: {share}" for name, share in shares.items())
        if all(share.seen < _LEAST_SEEN for share in shares.values()):
            why = "it is dark" if is_dark(self._last.image) else "the camera shows none of it"
            return SkillFailure(Cause.EXECUTION, f"{names} could not be looked at from here: {why}")
        if found:
            told = f"{counted(found, inputs.surfaces)}, and not {inputs.count} ({seen})"
            return SkillFailure(Cause.POSTCONDITION, told)
        return SkillFailure(Cause.POSTCONDITION, f"no {what} seen on {names} from here ({seen})")


def _fits_near(inputs: DetectInputs) -> bool:
    """Returns whether it was seen before and fits into a picture from near."""
    return inputs.seen_before is not None and max(inputs.seen_before.size_m) < _FITS_NEAR_M


def _is_wanted(inputs: DetectInputs, track: Track) -> bool:
    return THING in inputs.classes or track.class_name in inputs.classes


def _is_sure(inputs: DetectInputs, track: Track) -> bool:
    """Returns whether nothing more is to be seen of a track: for any object, its class does not matter."""
    views = 2 if inputs.seen_before is None else 1
    return track.stands(views) if THING in inputs.classes else track.confirmed(views)


def _observed(track: Track, attributes: tuple[str, ...]) -> ObjectObservation:
    """A track as an observation: its fused place, the rest from its last detection; a `THING` without a sure class."""
    seen = observation(replace(track.latest, position_W=track.position_W), attributes)
    return seen if track.confirmed(1) else replace(seen, kind=ObjectKind(THING, attributes))


def _tries_for(track: Track, shifts: int) -> int:
    """How often to look at a track again: once more from nearby where neither side showed its place."""
    return shifts + (track.views == 1 and track.missed == 0)


def _bearing(p_B: FloatArray) -> float:
    return math.atan2(p_B[1], p_B[0])


def _apart(p_W: Sequence[float] | FloatArray, q_W: Sequence[float] | FloatArray) -> float:
    """Level distance of two points."""
    return float(np.linalg.norm(np.asarray(p_W)[:2] - np.asarray(q_W)[:2]))


def _by_distance(surfaces: tuple[Surface, ...], X_WB: RigidTransform) -> list[Surface]:
    here = X_WB.translation()[:2]
    return sorted(surfaces, key=lambda s: float(np.min(np.linalg.norm(np.asarray(s.polygon_W) - here, axis=1))))
