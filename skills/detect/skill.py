"""The detect skill: searches surfaces with the hand camera, and confirms each object from a second viewpoint."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
from pydrake.math import RigidTransform

from skills.api import Cause, Question, Running, Succeeded
from skills.class_forms import ANY_OBJECT, known_attributes
from skills.descriptions import count_sentence, describe, describe_unknown, surface_names, wanted_names
from skills.detect.look import Look, UnknownObject, examine_image
from skills.detect.messages import (
    coverage_message,
    detections_message,
    object_destination_message,
    object_to_detect_message,
    tracks_message,
)
from skills.detect.selection import (
    DetectInputs,
    DetectOptions,
    doubtful_tracks,
    is_of_kind,
    is_sure,
    matching_tracks,
    meant_tracks,
    sure_tracks,
    why_not_meant,
)
from skills.detect.viewpoints import look_targets, surface_boxes
from skills.geometry import wrap
from skills.inputs.errors import listing, with_article
from skills.manipulation.arm.looking_skill import LookingSkill
from skills.manipulation.arm.poses import close_viewpoints, overview_viewpoints, viewpoints_beside
from skills.perception.class_evidence import SURE_SCORE
from skills.perception.detection_3d import observation
from skills.perception.detector.camera_images import (
    DETECTION_LATENCY_S,
    is_dark,
)
from skills.perception.point_cloud import Coverage, in_plain_view
from skills.perception.tracker import Track, Tracker
from skills.relations import ordinal
from skills.robot import FloatArray, Mount
from skills.routine import PlanningAttempt, Routine, SkillFailure
from skills.world_model import ObjectKind, ObjectObservation

_LEAST_SEEN = 0.02
_LEAST_IN_VIEW = 0.5
"""Fraction of a surface in the view of a camera that is fixed to the body."""
_FITS_NEAR_M = 0.4
_BELOW_TOP_M = 0.01
_ANSWER_S = 30.0
"""Time limit for the answer which of several objects is meant."""
_NEAR_SHIFTS_RAD = (0.0, 0.6, -0.6)
"""Angles about a doubtful object from which it is viewed from near, one after the other."""
_NEAR_UNTIL_S = 50.0
"""Time of a search up to which near views of doubtful objects begin, so that its time limit is not passed."""
_MOST_NAMED = 3
"""Number of unexplained objects that a message names."""
_RAISED_M = 0.15
"""Height by which the body rises for one more view by a camera on a head."""


class Detect(LookingSkill[DetectInputs]):
    """Searches surfaces for objects without driving. Stows the arm when it finds too few."""

    name = "detect"
    needs_camera = True
    Inputs = DetectInputs
    outputs: ClassVar[Mapping[str, type]] = {
        "observation": ObjectObservation,
        "observations": tuple[ObjectObservation, ...],
        "unexplained": tuple[ObjectObservation, ...],
    }
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "a class, attribute or surface cannot be searched for from here, or there is no camera",
        Cause.PLANNING: "the arm reaches no viewpoint",
        Cause.EXECUTION: "the arm did not reach its viewpoint, the camera shows nothing, or something is unexplained",
        Cause.POSTCONDITION: "no such object is seen, or fewer than asked for",
    }
    default_timeout_s = 90.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"observation": 3.0}
    Options: ClassVar[type] = DetectOptions
    options: DetectOptions

    def run(self, inputs: DetectInputs) -> Routine[Succeeded]:
        """Searches each surface in turn; an object counts when a view from another side confirms it."""
        models = self.context.detector.models
        self._height_m = 0.0 if inputs.seen_before is None else inputs.seen_before.size_m[2]
        self._own = models if any(name in models for name in inputs.classes) else {}
        self._only_own = {*self._own} - {*self.context.detector.class_names}
        self._check(inputs)
        self._own = self._own if self.object_camera.on_hand else models  # no nearer looks follow, which would use them
        self.context.publish("object_to_detect", object_to_detect_message(self.context, inputs.classes))
        X_WB = self.X_WB()
        self.boxes = surface_boxes(inputs.surfaces, X_WB)
        targets = self._targets(inputs, X_WB)
        if not targets:
            raise SkillFailure(Cause.PRECONDITION, f"{surface_names(inputs.surfaces)} is out of sight from here")
        names = (*self.context.detector.class_names, *models)
        self._tracker, self._coverage = Tracker(tuple(dict.fromkeys(names))), Coverage(inputs.surfaces)
        self._tried: dict[int, int] = {}
        self._unknown: dict[int, UnknownObject] = {}
        self._near_until_s = self.context.clock.now() + _NEAR_UNTIL_S
        self._is_covered = False
        self._fits_near = inputs.seen_before is not None and max(inputs.seen_before.size_m) < _FITS_NEAR_M
        blocked: list[SkillFailure] = []
        targets_W = [X_WB @ p_BT for p_BT in targets]
        for k, p_WT in enumerate(targets_W):
            p_BT = self.X_WB().inverse() @ p_WT
            yield from self._look_and_confirm(inputs, p_BT, blocked, close=self._fits_near)
            if self._has_enough(inputs):
                break
            yield Running(f"looking for {wanted_names(inputs.classes, inputs.attributes)}", (k + 1) / len(targets))
        self._is_covered = True
        yield from self._look_closer(inputs)
        yield from self._look_around(inputs)
        yield from self._look_from_above(inputs, targets_W)
        yield from self._refresh(inputs)
        self.context.publish("surfaces_seen", coverage_message(self.context, self._coverage.shares()))
        return (yield from self._ended(inputs, blocked if len(blocked) == len(targets) else []))

    def _check(self, inputs: DetectInputs) -> None:
        """Raises SkillFailure with cause PRECONDITION for an unknown class or attribute, and without surfaces."""
        knows = {*self.context.detector.class_names, ANY_OBJECT, *self._own}
        unknown = [name for name in inputs.sought if name not in knows]
        words = (*inputs.attributes, *(word for each in inputs.landmarks for word in each.attributes))
        unknown += [word for word in words if word.lower() not in known_attributes()]
        if unknown:
            raise SkillFailure(Cause.PRECONDITION, f"I do not know what {', '.join(unknown)} looks like")
        if not inputs.surfaces:
            raise SkillFailure(Cause.PRECONDITION, "there is no surface to look at")
        _ = self.object_camera

    def _targets(self, inputs: DetectInputs, X_WB: RigidTransform) -> list[FloatArray]:
        """Points p_BT to view, in this order."""
        if inputs.expected_W is not None:
            return [X_WB.inverse() @ np.array(inputs.expected_W)]
        here = X_WB.translation()[:2]
        nearest_first = sorted(
            inputs.surfaces, key=lambda s: float(np.min(np.linalg.norm(np.asarray(s.polygon_W) - here, axis=1)))
        )
        return [target for surface in nearest_first for target in look_targets(surface, X_WB, self.p_BS)]

    def _has_enough(self, inputs: DetectInputs) -> bool:
        if inputs.relations:
            return self._is_covered and 0 < inputs.count == len(self._meant(inputs))
        return 0 < inputs.count <= len(self._sure(inputs))

    def _look_closer(self, inputs: DetectInputs) -> Routine[None]:
        """Views the expected position from near, or objects that may be wanted, from near and from three sides."""
        if inputs.expected_W is not None:
            if not self._has_enough(inputs):
                p_BT = self.X_WB().inverse() @ np.array(inputs.expected_W)
                yield from self._look_and_confirm(inputs, p_BT, [], close=not self._fits_near)
            return
        viewed, shifts_rad = Counter[int](), _NEAR_SHIFTS_RAD[: self.options.closer_looks]
        most = self.options.candidates * len(shifts_rad) if self.object_camera.on_hand else 0
        while not self._has_enough(inputs) and viewed.total() < most and self.context.clock.now() < self._near_until_s:
            left = [track for track in self._doubts(inputs) if viewed[track.number] < len(shifts_rad)]
            if not left:
                return
            self._own = self.context.detector.models  # imported objects explain what else may be sought
            shift_rad = shifts_rad[viewed[left[0].number]]
            viewed[left[0].number] += 1
            p_BT = self.X_WB().inverse() @ left[0].position_W
            yield from self._look_and_confirm(inputs, p_BT, [], close=True, shift_rad=shift_rad)

    def _doubts(self, inputs: DetectInputs) -> list[Track]:
        """Tracks of objects that may be what is sought although nothing recognises them, likeliest first."""
        if inputs.expected_W is not None or {*inputs.classes} <= {ANY_OBJECT, *self._only_own}:
            return []
        sure = {track.number for track in self._sure(inputs)}
        return [track for track in doubtful_tracks(self._tracker.snapshot(), inputs) if track.number not in sure]

    def _likely(self, inputs: DetectInputs) -> list[Track]:
        """Tracks that count where nothing is recognised: more likely of a wanted class than of any other."""
        if not inputs.likely or inputs.relations or self._sure(inputs):
            return []
        return [track for track in self._doubts(inputs) if is_of_kind(track, inputs)]

    def _look_around(self, inputs: DetectInputs) -> Routine[None]:
        """Views occluded areas from both sides; a camera on a head cannot change sides."""
        around = inputs.expected_W is None and self.object_camera.on_hand
        for p_W in self._coverage.hidden_middle_W().values() if around else ():
            for shift_rad in self.options.around_rad:
                if self._has_enough(inputs):
                    return
                p_BT = self.X_WB().inverse() @ p_W
                yield from self._look_and_confirm(inputs, p_BT, [], shift_rad=shift_rad)

    def _look_from_above(self, inputs: DetectInputs, targets_W: Sequence[FloatArray]) -> Routine[None]:
        """Raises the body as high as possible, for a head camera, which sees tables at a flat angle.

        The body stays high when the objects are found, which may be occluded from lower down.
        """
        raised_m = self._raised_m()
        if self.object_camera.on_hand or raised_m < _RAISED_M or self._has_enough(inputs):
            return
        for p_WT in targets_W:
            p_BT = self.X_WB().inverse() @ p_WT
            yield from self._look_and_confirm(inputs, p_BT, [], raised_m=raised_m)
            if self._has_enough(inputs):
                return
        yield from self.stand_as_usual()

    def _refresh(self, inputs: DetectInputs) -> Routine[None]:
        """Views the result once more when its picture is old."""
        if (track := self._old_result(inputs)) is not None:
            yield from self._look_and_confirm(inputs, self.X_WB().inverse() @ track.position_W, [])
        if (track := self._old_result(inputs)) is not None:  # hidden from there: use the viewpoint of its last view
            X_BW = self.X_WB().inverse()
            p_BO, eye_B = X_BW @ track.position_W, X_BW @ np.array(track.eyes_W[-1])
            viewpoints = [*viewpoints_beside(self.p_BS, eye_B, p_BO), *self._viewpoints(p_BO)]
            with PlanningAttempt():
                yield from self.look(inputs, p_BO, viewpoints)

    def _old_result(self, inputs: DetectInputs) -> Track | None:
        """The track seen last, if it is reliable and its picture is old."""
        newest = next(iter((*self._meant(inputs), *self._likely(inputs))), None)
        return newest if newest is not None and self._is_old(newest) else None

    def _is_old(self, track: Track) -> bool:
        return self.context.clock.now() - track.last_seen_s > self.options.fresh_s

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
        """Views a point, and candidates again from the side. Appends a failure of the arm to `blocked`."""
        viewpoints = self._viewpoints(p_BT, shift_rad, close=close)
        with PlanningAttempt() as attempt:
            yield from self.look(inputs, p_BT, viewpoints, raised_m)
        if attempt.failure is not None:
            blocked.append(attempt.failure)
            return
        while (track := self._candidate(inputs)) is not None:
            tries = self._tried[track.number] = self._tried.get(track.number, 0) + 1
            p_BO = self.X_WB().inverse() @ track.position_W
            other_m = _RAISED_M * (tries % 3)
            other_m = raised_m - other_m if raised_m > 0.0 else other_m
            viewpoints = self._confirming(track, tries, close=close)
            with PlanningAttempt():
                yield from self.look(inputs, p_BO, viewpoints, other_m)

    def _viewpoints(self, p_BT: FloatArray, shift_rad: float = 0.0, *, close: bool = False) -> list[FloatArray]:
        """Camera positions p_BC to view p_BT, rotated by shift_rad about the shoulder; near ones first if `close`."""
        far = overview_viewpoints(self.p_BS, p_BT, shift_rad, self._height_m)
        if abs(shift_rad) >= max(map(abs, self.options.around_rad)):
            far = sorted(far, key=lambda p_BC: -float(np.linalg.norm((p_BC - self.p_BS)[:2])))
        return [*close_viewpoints(self.p_BS, p_BT, shift_rad), *far] if close else far

    def _confirming(self, track: Track, tries: int, *, close: bool) -> list[FloatArray]:
        """Camera positions for the first, second or third confirming view of a track.

        First on the side farther from its last view, then on the other side, then right beside the last view.
        """
        X_BW = self.X_WB().inverse()
        p_BO, eye_B = X_BW @ track.position_W, X_BW @ np.array(track.eyes_W[-1])
        if tries > len(self.options.confirm_shifts_rad):
            return [*viewpoints_beside(self.p_BS, eye_B, p_BO), *self._viewpoints(p_BO)]
        seen_rad, bearing = _bearing(eye_B - self.p_BS), _bearing(p_BO - self.p_BS)
        off = {shift: abs(wrap(bearing + shift - seen_rad)) for shift in self.options.confirm_shifts_rad}
        shifts_rad = sorted(self.options.confirm_shifts_rad, key=lambda shift: -off[shift])
        return self._viewpoints(p_BO, shifts_rad[tries - 1], close=close)

    def _candidate(self, inputs: DetectInputs) -> Track | None:
        """The most likely track that needs another view, or None; one more when neither side showed its position."""
        many = len(self._tried) > self.options.candidates + inputs.count and not inputs.relations
        if many or self._has_enough(inputs):
            return None
        shifts = len(self.options.confirm_shifts_rad)
        for track in self._matching(inputs):
            tries = shifts + (track.views == 1 and track.missed == 0)
            if not is_sure(track, inputs, self._views(inputs)) and self._tried.get(track.number, 0) < tries:
                return track
        return None

    def _matching(self, inputs: DetectInputs) -> list[Track]:
        return matching_tracks(self._tracker.snapshot(), inputs, self.options, self.X_WB().translation())

    def _sure(self, inputs: DetectInputs) -> list[Track]:
        return sure_tracks(self._matching(inputs), inputs, self._views(inputs))

    def _meant(self, inputs: DetectInputs) -> list[Track]:
        """Reliable tracks that the relations mean; all of them when there are no relations."""
        sure = self._sure(inputs)
        return meant_tracks(sure, inputs, self.context.pose()) if inputs.relations else sure

    def _views(self, inputs: DetectInputs) -> int:
        """Number of viewpoints that a reliable track needs: one where the camera cannot change its position."""
        mount, rises = self.object_camera.mount, self._raised_m() >= _RAISED_M
        return 2 if inputs.seen_before is None and (mount is Mount.HAND or (mount is Mount.HEAD and rises)) else 1

    def _raised_m(self) -> float:
        """Height by which the body can rise for a view from above."""
        capabilities = self.context.robot.capabilities()
        return capabilities.height_range_m[1] - capabilities.standing_height_m - _BELOW_TOP_M

    def look(
        self, inputs: DetectInputs, p_BT: FloatArray, viewpoints_B: Sequence[FloatArray], raised_m: float = 0.0
    ) -> Routine[Look]:
        """Points the camera at p_BT from the first feasible viewpoint in `viewpoints_B`, and updates the tracks.

        With a head camera, the body rises by raised_m.
        """
        message = f"looking for {wanted_names(inputs.classes, inputs.attributes)}"
        yield from self.look_at(p_BT, viewpoints_B, message, raised_m=raised_m)
        image = yield from self.picture(message)
        place, detector = self.context.localiser.estimate(), self.context.detector

        def examine() -> Look:
            return examine_image(image, place, detector, inputs, self._own, {*inputs.classes} <= self._only_own)

        look = yield from self.compute(examine, latency_s=DETECTION_LATENCY_S, name="detect", message=message)
        self._update(look, ANY_OBJECT in inputs.classes)
        return look

    def _update(self, look: Look, things: bool) -> None:
        """Updates coverage and tracks; publishes the detections, with own objects and wanted `things`."""
        X_WO = look.localisation.X_WO
        if not is_dark(look.image):
            self._coverage.add(look.image, X_WO)
        tracks = self._tracker.update(
            look.detections_3d,
            lambda t: in_plain_view(look.image, X_WO, t.position_W, 0.5 * max(t.latest.size_m)),
        )
        shown = {*self._own, ANY_OBJECT} if things else {*self._own}
        placed = [each.detection for each in look.detections_3d if each.detection.class_name in shown]
        own = [each for each in placed if all(each is not one for one in look.detections)]
        sure = [detection for detection in (*look.detections, *own) if detection.score >= SURE_SCORE]
        self.context.publish("detections", detections_message(look.image, sure, look.detections_3d))
        self.context.publish("tracks", tracks_message(self.context, tracks))
        for track in tracks:
            if any(track.latest is each for each in look.detections_3d) and not track.is_confirmed(1):
                self._unknown.setdefault(track.number, UnknownObject()).add(look, track.latest)
        self._last = look

    def _ended(self, inputs: DetectInputs, blocked: Sequence[SkillFailure]) -> Routine[Succeeded]:
        """Returns the result. Raises SkillFailure when too few objects were found."""
        found = [_observed(track, inputs.attributes) for track in self._results(inputs)]
        if inputs.relations and inputs.count == 1 and len(found) > 1:
            found = [(yield from self._which(inputs, found))]
        likely = self._likely(inputs)[:1]
        found += [replace(_observed(t, ()), kind=ObjectKind(t.class_name, inputs.attributes)) for t in likely]
        if found and len(found) >= inputs.count:
            look = self._last
            for seen in found:
                message = object_destination_message(self.context, seen, look.image, look.localisation.X_WO)
                self.context.publish("object_destination", message)
            saw = "saw what is most likely" if likely else "saw"
            said = f"{saw} {describe(found[0])}" if inputs.count == 1 else count_sentence(found, inputs.surfaces)
            doubts = self._doubts(inputs) if inputs.count == 0 else []
            said += f"; {self._unexplained(doubts)}" if doubts else ""
            outputs = {"observation": found[0], "observations": tuple(found)}
            return Succeeded(said, outputs | {"unexplained": tuple(_observed(each, ()) for each in doubts)})
        yield from self.try_stow()
        if blocked:
            raise blocked[0]
        raise self._too_few(inputs, found)

    def _cannot_tell(
        self, inputs: DetectInputs, found: Sequence[ObjectObservation], doubts: Sequence[Track]
    ) -> SkillFailure:
        """Failure for objects that may be what is sought."""
        what = wanted_names(inputs.classes, inputs.attributes)
        known = f"{count_sentence(found, inputs.surfaces)}, and " if found else ""
        what = f"{known}I cannot tell whether there is {'another' if found else with_article(what)}"
        return SkillFailure(Cause.EXECUTION, f"{what}: {self._unexplained(doubts)}")

    def _unexplained(self, doubts: Sequence[Track]) -> str:
        """Describes unexplained objects, and shows a picture of each: "something 24 cm tall stands on the desk"."""
        said = [describe_unknown(_observed(track, ())) for track in doubts[:_MOST_NAMED]]
        for track, what in zip(doubts, said, strict=False):
            if (seen := self._unknown.get(track.number)) is not None:
                self.context.show_picture(seen.picture, f"What is this? {what.capitalize()}", **seen.facts())
        return listing(said)

    def _results(self, inputs: DetectInputs) -> list[Track]:
        """Reliable tracks in the order of the result; when any object is wanted, those with a fresh picture first."""
        found = self._meant(inputs)
        if inputs.expected_W is not None or ANY_OBJECT not in inputs.classes:
            return found
        return sorted(found, key=self._is_old)

    def _which(self, inputs: DetectInputs, found: Sequence[ObjectObservation]) -> Routine[ObjectObservation]:
        """Asks which of several objects is meant. Raises SkillFailure, which is final, when nobody says it."""
        origin = self.X_WB().inverse()
        row = sorted(found, key=lambda seen: -_bearing(origin @ np.array(seen.position_W)))
        names = {f"{ordinal(number)} from the left": seen for number, seen in enumerate(row, start=1)}
        relations = " and ".join(map(str, inputs.relations))
        several = f"{count_sentence(found, inputs.surfaces)} {relations}"
        question = Question(f"which of {self.context.robot.name}", f"{several}: which one?", (*names,), "", _ANSWER_S)
        answer = yield from self._awaited(self.context.ask(question), f"asking which one is meant: {several}")
        if answer not in names:
            yield from self.try_stow()
            raise SkillFailure(Cause.PRECONDITION, f"{several}, and it is not said which one", final=True)
        return names[answer]

    def _too_few(self, inputs: DetectInputs, found: Sequence[ObjectObservation]) -> SkillFailure:
        """Failure that says how much of each surface was seen."""
        shares = self._coverage.shares()
        what, names = wanted_names(inputs.classes, inputs.attributes), surface_names(inputs.surfaces)
        seen = "; ".join(f"{name}: {share}" for name, share in shares.items())
        if all(share.seen < _LEAST_SEEN for share in shares.values()):
            why = "it is dark" if is_dark(self._last.image) else "the camera shows none of it"
            return SkillFailure(Cause.EXECUTION, f"{names} could not be looked at from here: {why}")
        shown = max(share.seen + share.hidden for share in shares.values())
        if self.object_camera.mount is Mount.BODY and shown < _LEAST_IN_VIEW:
            why = f"most of it is out of the camera's view ({seen})"
            return SkillFailure(Cause.EXECUTION, f"{names} could not be looked at from here: {why}")
        if doubts := self._doubts(inputs):
            return self._cannot_tell(inputs, found, doubts)
        unmeant = why_not_meant(self._sure(inputs), inputs) if inputs.relations and not found else None
        if unmeant is not None:
            return SkillFailure(Cause.POSTCONDITION, f"{unmeant} ({seen})")
        if found:
            few = f"{count_sentence(found, inputs.surfaces)}, fewer than {inputs.count} ({seen})"
            return SkillFailure(Cause.POSTCONDITION, few)
        return SkillFailure(Cause.POSTCONDITION, f"no {what} seen on {names} from here ({seen})")


def _observed(track: Track, attributes: tuple[str, ...]) -> ObjectObservation:
    """Observation of a track: fused position, the rest from its last detection; `ANY_OBJECT` for an unsure class."""
    seen = observation(replace(track.latest, position_W=track.position_W), attributes)
    return seen if track.is_confirmed(1) else replace(seen, kind=ObjectKind(ANY_OBJECT, attributes))


def _bearing(p_B: FloatArray) -> float:
    return math.atan2(p_B[1], p_B[0])
