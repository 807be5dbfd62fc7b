"""What the detect skill writes to the event log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydrake.math import RigidTransform

from skills.api import ObjectObservation, SkillContext
from skills.detect.appearance import load_appearance
from skills.detect.interim_segmentation import Sighting, observation
from skills.detect.points import camera_pose_W
from skills.robot import Image


def detections_message(image: Image, found: Sequence[Sighting]) -> Mapping[str, Any]:
    """All sightings of one picture, with boxes (u0, v0, u1, v1) in its pixels, and the picture itself."""
    return {
        "stamp_s": image.stamp_s,
        "source": image.source,
        "detections": [_detection(image, sighting) for sighting in found],
        "image": image.colour,
    }


def _detection(image: Image, sighting: Sighting) -> Mapping[str, Any]:
    seen = observation(sighting, image.stamp_s)
    return {
        "class_id": load_appearance().classes[sighting.class_name].id,
        "class_name": sighting.class_name,
        "score": round(sighting.score, 3),
        "box": list(sighting.cluster.box),
        "surface": seen.surface or "",
        "position_W": [round(value, 4) for value in seen.position_W],
        "size_m": [round(value, 4) for value in seen.size_m],
    }


def object_to_detect_message(context: SkillContext, classes: Sequence[str]) -> Mapping[str, Any]:
    """What is being looked for."""
    known = load_appearance().classes
    return {
        "stamp": context.clock.now(),
        "robot_name": context.robot.name,
        "class_id": [known[name].id for name in classes],
        "class_name": list(classes),
    }


def object_destination_message(
    context: SkillContext, seen: ObjectObservation, image: Image, X_WO: RigidTransform
) -> Mapping[str, Any]:
    """Where the thing is: in the world, and from the camera."""
    p_CO = camera_pose_W(image, X_WO).inverse() @ seen.position_W
    sequence = round(image.stamp_s * 1000)
    return {
        "stamp": context.clock.now(),
        "sequence": sequence,
        "message_id": f"{context.robot.name}-{sequence}",
        "class_id": load_appearance().classes[seen.thing.name].id,
        "class_name": seen.thing.name,
        "goal_x": seen.position_W[0],
        "goal_y": seen.position_W[1],
        "goal_z": seen.position_W[2],
        "distance_from_robot_x": float(p_CO[0]),
        "distance_from_robot_y": float(p_CO[1]),
        "distance_from_robot_z": float(p_CO[2]),
    }
