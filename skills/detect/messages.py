"""Messages that the detect skill writes to the event log."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pydrake.math import RigidTransform

from skills.api import Detection, ObjectObservation, SkillContext
from skills.class_forms import class_form
from skills.perception.detection_3d import Detection3D
from skills.perception.point_cloud import SurfaceShares, camera_pose_W
from skills.perception.tracker import Track
from skills.robot import Image

Message = Mapping[str, Any]


def detections_message(image: Image, found: Iterable[Detection], placed: Sequence[Detection3D]) -> Message:
    """Message with all detections in one picture, boxes (u0, v0, u1, v1) in its pixels, and the picture."""
    places = {id(detected.detection): detected for detected in placed}
    return {
        "stamp_s": image.stamp_s,
        "source": image.source,
        "detections": [_detection(each, places.get(id(each))) for each in found],
        "image": image.grey if image.colour is None else image.colour,
    }


def _detection(detection: Detection, placed: Detection3D | None) -> Message:
    message = {
        "class_id": class_form(detection.class_name).id,
        "class_name": detection.class_name,
        "score": round(detection.score, 3),
        "box": [round(value) for value in detection.box],
        "surface": "",
    }
    if placed is None:
        return message
    place = {
        "surface": placed.surface or "",
        "position_W": _rounded(placed.position_W),
        "sigma_m": _rounded(placed.place_covariance.diagonal() ** 0.5),
        "size_m": _rounded(placed.size_m),
    }
    return {**message, **place}


def object_to_detect_message(context: SkillContext, classes: Sequence[str]) -> Message:
    """Message with the wanted classes."""
    return {
        "stamp": context.clock.now(),
        "robot_name": context.robot.name,
        "class_id": [class_form(name).id for name in classes],
        "class_name": list(classes),
    }


def object_destination_message(
    context: SkillContext, seen: ObjectObservation, image: Image, X_WO: RigidTransform
) -> Message:
    """Message with the object's position in the world and relative to the camera."""
    p_CO = camera_pose_W(image, X_WO).inverse() @ seen.position_W
    sequence = round(image.stamp_s * 1000)
    return {
        "stamp": context.clock.now(),
        "sequence": sequence,
        "message_id": f"{context.robot.name}-{sequence}",
        "class_id": class_form(seen.kind.name).id,
        "class_name": seen.kind.name,
        "goal_x": seen.position_W[0],
        "goal_y": seen.position_W[1],
        "goal_z": seen.position_W[2],
        "distance_from_robot_x": float(p_CO[0]),
        "distance_from_robot_y": float(p_CO[1]),
        "distance_from_robot_z": float(p_CO[2]),
    }


def tracks_message(context: SkillContext, tracks: Sequence[Track]) -> Message:
    """Message with all tracks."""
    tracked = [_track(track) for track in tracks]
    return {"stamp": context.clock.now(), "robot_name": context.robot.name, "tracks": tracked}


def _track(track: Track) -> Message:
    return {
        "number": track.number,
        "class_name": track.class_name,
        "class_belief": round(track.class_belief, 3),
        "belief": round(track.belief, 3),
        "confirmed": track.is_confirmed(),
        "views": track.views,
        "missed": track.missed,
        "last_seen_s": track.last_seen_s,
        "surface": track.latest.surface or "",
        "position_W": _rounded(track.position_W),
        "sigma_m": _rounded(track.covariance.diagonal() ** 0.5),
    }


def coverage_message(context: SkillContext, shares: Mapping[str, SurfaceShares]) -> Message:
    """Message with the fraction of each surface that was seen."""
    surfaces = {
        name: {"seen": round(s.seen, 3), "hidden": round(s.hidden, 3), "out_of_view": round(s.out_of_view, 3)}
        for name, s in shares.items()
    }
    return {"stamp": context.clock.now(), "surfaces": surfaces}


def _rounded(values: Iterable[float]) -> list[float]:
    return [round(float(value), 4) for value in values]
