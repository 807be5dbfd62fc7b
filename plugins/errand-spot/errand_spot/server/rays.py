"""Rays against the depth pictures of the robot's cameras: the point that a pixel shows, and the `ray-cast` service."""

from __future__ import annotations

from functools import partial
from typing import Any, Final

import numpy as np
from bosdyn.api import ray_cast_pb2

from errand_spot.messages import frame_tree, vec3, vector
from errand_spot.server.calls import Call, Service
from errand_spot.server.computer import Computer
from errand_spot.server.identity import DOMAIN
from skills.robot import FloatArray, NoImageError

_WIDE_M, _WIDER = 0.01, 0.006
"""Radius of a ray (m), and its growth with the distance: about half a pixel of depth."""
_DEEP_M, _NEAREST_M = 0.03, 0.05
_TIMEOUT_S: Final = 5.0


def depth_points_O(computer: Computer, *, hand: bool = True, body: bool = True) -> FloatArray:
    """Takes a depth picture with each camera; returns their points (N, 3) in `odom`. For the computer's thread."""
    found = [np.empty((0, 3))]
    for camera in computer.capabilities.cameras:
        if not (hand if camera.on_hand else body):
            continue
        try:
            image = computer.robot.image(camera.source, visual=False)
        except NoImageError:
            continue
        lens, (v, u) = image.depth_intrinsics, np.nonzero(image.depth_m > 0.0)
        z = image.depth_m[v, u].astype(np.float64)
        points_C = np.column_stack([(u - lens.cx) / lens.fx * z, (v - lens.cy) / lens.fy * z, z])
        found.append((image.frames.pose(image.camera_frame) @ points_C[np.isfinite(z)].T).T)
    return np.concatenate(found)


def first_hit_m(origin: FloatArray, direction: FloatArray, points: FloatArray, least_m: float = 0.0) -> float | None:
    """Returns how far along a ray (unit direction), from least_m on, it first meets points (N, 3); None for none."""
    offsets = points - origin
    along_m = offsets @ direction
    aside_m = np.linalg.norm(offsets - along_m[:, None] * direction, axis=1)
    met_m = along_m[(along_m > max(least_m, _NEAREST_M)) & (aside_m < _WIDE_M + _WIDER * along_m)]
    return float(np.median(met_m[met_m < met_m.min() + _DEEP_M])) if met_m.size else None


class RayCastService(Service):
    """Casts rays against the floor and the present depth pictures; the robot keeps no map of terrain or voxels."""

    name, type, authority = "ray-cast", "bosdyn.api.RayCastService", f"api.{DOMAIN}"
    checks_values = True

    def __init__(self, computer: Computer) -> None:
        self._computer = computer

    def Raycast(self, request: Any, _call: Call) -> Any:
        """Returns the hits of a ray in `odom`, the nearest first. Without types it meets all of them."""
        Response, Hit, snapshot = ray_cast_pb2.RaycastResponse, ray_cast_pb2.RayIntersection, self._computer.snapshot
        types = set(request.intersection_types) or {Hit.TYPE_GROUND_PLANE, Hit.TYPE_VOXEL_MAP, Hit.TYPE_HAND_DEPTH}
        origin, ahead = vector(request.ray.origin, "ray.origin"), vector(request.ray.direction, "ray.direction")
        if request.ray_frame_name not in snapshot.frames:
            said = f"frame {request.ray_frame_name!r} is unknown"
            return Response(status=Response.STATUS_UNKNOWN_FRAME, message=said)
        if types & {Hit.TYPE_UNKNOWN, Hit.TYPE_TERRAIN_MAP} or not types <= set(Hit.Type.values()):
            return Response(status=Response.STATUS_INVALID_INTERSECTION_TYPE, message="there is no map of the terrain")
        if (length := float(np.linalg.norm(ahead))) < 1e-6:
            return Response(status=Response.STATUS_INVALID_REQUEST, message="ray.direction has no length")
        X_OF = snapshot.X_AB("odom", request.ray_frame_name)
        origin_O = np.asarray(X_OF @ np.array(origin))
        direction_O = np.asarray(X_OF.rotation() @ (np.array(ahead) / length))
        least_m, hits = float(request.min_intersection_distance), list[tuple[float, int]]()
        if Hit.TYPE_GROUND_PLANE in types and direction_O[2] < -1e-6:
            hits.append((float(-origin_O[2] / direction_O[2]), Hit.TYPE_GROUND_PLANE))
        for kind, hand in ((Hit.TYPE_VOXEL_MAP, False), (Hit.TYPE_HAND_DEPTH, True)):
            if kind in types:
                seen = self._computer.do(partial(depth_points_O, self._computer, hand=hand, body=not hand))
                far_m = first_hit_m(origin_O, direction_O, seen.result(_TIMEOUT_S), least_m)
                hits += [] if far_m is None else [(far_m, kind)]
        made = Response(status=Response.STATUS_OK, hit_frame_name="odom")
        made.transforms_snapshot.CopyFrom(frame_tree(snapshot.frames))
        for far_m, kind in sorted(hits):
            if far_m >= least_m:
                place = vec3(origin_O + far_m * direction_O)
                made.hits.add(type=kind, hit_position_in_hit_frame=place, distance_meters=far_m)
        return made
