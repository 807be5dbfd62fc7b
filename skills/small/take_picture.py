"""The take_picture skill: points a camera at something, and takes one picture of it for the report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from skills.api import PICTURES, Cause, ObjectObservation, Succeeded
from skills.manipulation.arm.looking_skill import LookingSkill
from skills.manipulation.arm.poses import overview_viewpoints
from skills.perception.detector.camera_images import is_dark
from skills.quantities import Coordinate, Height
from skills.robot import CameraCapabilities, FloatArray, Image
from skills.routine import PlanningAttempt, Routine, SkillFailure

_ASIDE_RAD: Final = (0.0, 0.35, -0.35)
"""Turns about the shoulder of the hand camera's viewpoints, the best first."""


@dataclass(frozen=True)
class TakePictureInputs:
    """Subject of a picture: `of` in words, and its point in the world, or an observed object.

    `camera` is one of the robot's cameras. Without it, the camera that searches for objects takes the picture, or else
    one on the body that sees the point.
    """

    of: str
    point_W: tuple[Coordinate, Coordinate, Height] | None = None
    object: ObjectObservation | None = None
    camera: str = ""


class TakePicture(LookingSkill[TakePictureInputs]):
    """Points a camera at something and publishes one picture with the camera's pose. Does not drive."""

    name = "take_picture"
    needs_camera = True
    Inputs = TakePictureInputs
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "the robot has no such camera, or nothing is named to point it at",
        Cause.PLANNING: "the arm reaches no viewpoint, and no other camera sees it from here",
        Cause.EXECUTION: "the arm did not reach its viewpoint, or the camera shows nothing",
    }
    default_timeout_s = 60.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 1.0, "joints": 0.5, "gripper": 0.5}
    _camera: CameraCapabilities | None = None

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
                yield from self.look_at(p_BT, self._viewpoints(p_BT), message)
            if attempt.failure is None:
                image = yield from self.picture(message)
                return self._taken(inputs.of, image)
            blocked.append(attempt.failure)
        raise SkillFailure(Cause.PLANNING, f"no view of {inputs.of} from here: {blocked[0].message}")

    def _cameras(self, named: str) -> Sequence[CameraCapabilities]:
        """Returns the named camera, or all, the usual one first. Raises SkillFailure with cause PRECONDITION."""
        cameras, self._camera = self.context.robot.capabilities().cameras, None
        if not named:
            first = self.object_camera
            return (first, *(each for each in cameras if each is not first))
        if known := [each for each in cameras if each.source == named.lower().replace(" ", "")]:
            return known
        what = f"the robot has no camera '{named}'; it has {', '.join(each.source for each in cameras)}"
        raise SkillFailure(Cause.PRECONDITION, what)

    def _viewpoints(self, p_BT: FloatArray) -> Sequence[FloatArray]:
        """Positions p_BC of the hand camera; none for another camera."""
        turns_rad = _ASIDE_RAD if self.object_camera.on_hand else ()
        return [p_BC for turn_rad in turns_rad for p_BC in overview_viewpoints(self.p_BS, p_BT, turn_rad)]

    def _taken(self, of: str, image: Image) -> Succeeded:
        """Publishes a picture with the camera's pose and the time. Raises SkillFailure for a dark picture."""
        if is_dark(image):
            raise SkillFailure(Cause.EXECUTION, f"the {image.source} camera shows nothing: it is dark")
        X_WC = self.context.localiser.estimate().X_WO @ image.frames.pose(image.camera_frame)
        x, y, z = p_WC = X_WC.translation().tolist()
        text = f"{of}, by the {image.source} camera at ({x:.2f}, {y:.2f}), {z:.2f} m high"
        pose = {"position_W": p_WC, "wxyz": X_WC.rotation().ToQuaternion().wxyz().tolist()}
        facts = {"robot": self.context.robot.name, "of": of, "camera": image.source, "stamp_s": image.stamp_s}
        picture = image.grey if image.colour is None else image.colour
        self.context.publish(PICTURES, {"caption": text, "image": picture, "pose": pose, **facts})
        return Succeeded(f"took a picture of {text}")
