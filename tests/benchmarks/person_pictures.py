"""Pictures of figures of people by the camera of Spot's hand, with its noise, from any pose."""

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from plant.robots.sensor_suite import Camera
from plant.robots.spot.kind import CAMERAS
from plant.sensors.camera_spec import load_cameras
from skills.robot import FrameTree


def camera_pose(p_W, target_W):
    """Pose of a camera at a point that looks at another."""
    z = (target_W - p_W) / np.linalg.norm(target_W - p_W)
    x = np.cross(z, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(z, [0.0, 0.0, 1.0]))
    return RigidTransform(RotationMatrix(np.column_stack([x, np.cross(z, x), z])), p_W)


def pictures(built, X_WC, times_s, rng):
    """Images of the camera at a pose in a Diagram, the first one with colour."""
    spec = load_cameras(CAMERAS)["hand"]
    rpy, p = X_WC.rotation().ToRollPitchYaw().vector(), X_WC.translation()
    spec = spec.model_copy(update={"rpy_deg": tuple(np.degrees(rpy)), "xyz_m": tuple(p)})
    camera = Camera(spec, built.scene_graph.world_frame_id(), rng, scene=built.scene)
    frames = FrameTree({spec.frame: ("odom", X_WC)})
    positions = built.plant.GetPositions(built.plant.CreateDefaultContext())
    return [camera.take(positions, time_s, frames, visual=k == 0) for k, time_s in enumerate(times_s)]
