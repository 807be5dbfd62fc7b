"""The take_picture skill: points a camera at something, and takes one picture of it for the report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np
from pydrake.math import RigidTransform

from skills.api import Cause, ObjectObservation, Running, Succeeded
from skills.capabilities import CameraCapabilities, Capabilities, Mount
from skills.inputs.errors import suggestion
from skills.manipulation.arm.looking_skill import LookingSkill
from skills.manipulation.arm.poses import overview_viewpoints
from skills.perception.detector.camera_images import is_dark
from skills.perception.point_cloud import nearest_pixels, project
from skills.quantities import Coordinate, Height
from skills.robot import FloatArray, Image
from skills.routine import Patience, PlanningAttempt, Routine, SkillFailure

_ASIDE_RAD: Final = (0.0, 0.35, -0.35)
"""Turns about the shoulder of the hand camera's viewpoints, the best first."""
_GOOD_HEALTH: Final = 0.5
"""Least health of an estimate that confirms where the robot stood."""
_HIDES_M: Final = 0.25
"""Distance before the point, along the optical axis, from which on something hides it."""
_AROUND_PX: Final = 4  # half the side of the window of depth around the point


@dataclass(frozen=True)
class TakePictureInputs:
    """Subject of a picture: `of` in words, and its point in the world, or an observed object.

    `camera` is one of the robot's cameras. Without it, the camera that searches for objects takes the picture, or else
    one on the body that sees the point. `top`: the point is on top of a surface, which is seen from above. `ahead`: the
    point only gives the direction, and whatever stands there is the subject.
    """

    of: str
    point_W: tuple[Coordinate, Coordinate, Height] | None = None
    object: ObjectObservation | None = None
    camera: str = ""
    top: bool = False
    ahead: bool = False


class TakePicture(LookingSkill[TakePictureInputs]):
    """Points a camera at something and publishes one picture with the camera's pose. Does not drive."""

    name = "take_picture"
    needs_camera = True
    Inputs = TakePictureInputs
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "the robot has no such camera, or nothing is named to point it at",
        Cause.PLANNING: "the arm reaches no viewpoint, and no other camera sees it from here",
        Cause.EXECUTION: "the arm did not reach its viewpoint, or the camera shows nothing",
        Cause.POSTCONDITION: "no later scan confirms the robot's place, or the point is hidden or not in the picture",
    }
    default_timeout_s = 60.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 1.0, "joints": 0.5, "gripper": 0.5}
    _camera: CameraCapabilities | None = None

    @classmethod
    def refuses(cls, inputs: Mapping[str, Any], capabilities: Capabilities) -> tuple[str, str] | None:
        """Error and hint for a camera that the robot lacks, or that is lower than the top to be seen."""
        named, cameras = inputs.get("camera", ""), {each.source: each for each in capabilities.cameras}
        camera = cameras.get(_source(named))
        if named and camera is None:
            hint = suggestion(_source(named), cameras) if cameras else "choose another kind of robot"
            return f"the robot has no camera '{named}'", hint
        if camera is None or not inputs.get("top") or camera.mount is not Mount.BODY:
            return None
        high_m, top_m = capabilities.standing_height_m + float(camera.X_FC.translation()[2]), inputs["point_W"][2]
        what = f"the {camera.source} camera, {high_m:.2f} m high, does not see a top {top_m:g} m high"
        return (what, "leave the camera out, or name a higher one") if high_m <= top_m else None

    @property
    def object_camera(self) -> CameraCapabilities:
        """Camera that takes the picture."""
        return self._camera or super().object_camera

    def run(self, inputs: TakePictureInputs) -> Routine[Succeeded]:
        """Tries the cameras in order until one is pointed at what the picture shows, and takes the picture."""
        message, blocked = f"taking a picture of {inputs.of}", list[SkillFailure]()
        p_WT = inputs.point_W if inputs.object is None else inputs.object.position_W
        if p_WT is None:
            raise SkillFailure(Cause.PRECONDITION, f"no point of {inputs.of} is given")
        for camera in self._cameras(inputs.camera):
            self._camera, p_BT = camera, self.X_WB().inverse() @ np.array(p_WT)
            with PlanningAttempt() as attempt:
                high_m = (self.X_WB() @ camera.X_FC).translation()[2]
                if inputs.top and camera.mount is Mount.BODY and high_m <= p_WT[2]:
                    what = f"the {camera.source} camera, {high_m:.2f} m high, does not see a top {p_WT[2]:.2f} m high"
                    raise SkillFailure(Cause.PLANNING, what)
                yield from self.look_at(p_BT, self._viewpoints(p_BT), message)
            if attempt.failure is None:
                image = yield from self.picture(message)
                X_WC = yield from self._confirmed_pose(image, message)
                p_CT, lens = X_WC.inverse() @ np.array(p_WT), image.intrinsics
                u, v = project(p_CT, lens)
                if p_CT[2] <= 0.0 or not (0.0 <= u < lens.width and 0.0 <= v < lens.height):
                    what = f"{inputs.of} is not in the picture: the robot was not where it believed to be"
                    raise SkillFailure(Cause.POSTCONDITION, what)
                hidden = None if inputs.ahead else _hidden(image, p_CT)
                if hidden is None:
                    return self._taken(inputs.of, image, X_WC)
                attempt.failure = SkillFailure(Cause.POSTCONDITION, f"the {camera.source} camera: {hidden}")
            blocked.append(attempt.failure)
        first = next((each for each in blocked if each.cause is Cause.POSTCONDITION), blocked[0])
        raise SkillFailure(first.cause, f"no view of {inputs.of} from here: {first.message}")

    def _cameras(self, named: str) -> Sequence[CameraCapabilities]:
        """Returns the named camera, or all, the usual one first. Raises SkillFailure with cause PRECONDITION."""
        cameras, self._camera = self.context.robot.capabilities().cameras, None
        if not named:
            first = self.object_camera
            return (first, *(each for each in cameras if each is not first))
        if known := [each for each in cameras if each.source == _source(named)]:
            return known
        what = f"the robot has no camera '{named}'; it has {', '.join(each.source for each in cameras)}"
        raise SkillFailure(Cause.PRECONDITION, what)

    def _viewpoints(self, p_BT: FloatArray) -> Sequence[FloatArray]:
        """Positions p_BC of the hand camera; none for another camera."""
        turns_rad = _ASIDE_RAD if self.object_camera.on_hand else ()
        return [p_BC for turn_rad in turns_rad for p_BC in overview_viewpoints(self.p_BS, p_BT, turn_rad)]

    def _confirmed_pose(self, image: Image, message: str) -> Routine[RigidTransform]:
        """Returns the pose X_WC of a picture's camera once a later scan agrees with the map. Raises SkillFailure."""
        patience, localiser = Patience(self.context.clock), self.context.localiser
        while (now := localiser.estimate()).stamp_s < image.stamp_s or not now.localised or now.health < _GOOD_HEALTH:
            if not patience.is_left():
                raise SkillFailure(Cause.POSTCONDITION, "no scan confirms where the picture was taken")
            yield Running(f"{message}; waits for a scan that confirms the place")
        return now.X_WO @ image.frames.pose(image.camera_frame)

    def _taken(self, of: str, image: Image, X_WC: RigidTransform) -> Succeeded:
        """Publishes a picture with the camera's pose and the time. Raises SkillFailure for a dark picture."""
        if is_dark(image):
            raise SkillFailure(Cause.EXECUTION, f"the {image.source} camera shows nothing: it is dark")
        x, y, z = p_WC = X_WC.translation().tolist()
        text = f"{of}, by the {image.source} camera at ({x:.2f}, {y:.2f}), {z:.2f} m high"
        pose = {"position_W": p_WC, "wxyz": X_WC.rotation().ToQuaternion().wxyz().tolist()}
        facts = {"robot": self.context.robot.name, "of": of, "camera": image.source, "stamp_s": image.stamp_s}
        picture = image.grey if image.colour is None else image.colour
        self.context.show_picture(picture, text, pose=pose, **facts)
        return Succeeded(f"took a picture of {text}")


def _hidden(image: Image, p_CT: FloatArray) -> str | None:
    """Returns why the depth of a picture does not show the point p_CT (3,) in the camera frame; None if it does."""
    column, row = nearest_pixels(*project(p_CT, image.depth_intrinsics), image.depth_intrinsics)
    low = np.maximum((row - _AROUND_PX, column - _AROUND_PX), 0)
    window = image.depth_m[low[0] : row + _AROUND_PX + 1, low[1] : column + _AROUND_PX + 1]
    measured_m, away_m = window[window > 0.0], float(p_CT[2])
    if not measured_m.size:
        return f"no depth shows whether something hides it, {away_m:.1f} m away"
    before_m = away_m - float(np.median(measured_m))
    return f"something {before_m:.1f} m before it hides it" if before_m > _HIDES_M else None


def _source(named: str) -> str:
    """Source of a camera named by a user."""
    return named.lower().replace(" ", "")
