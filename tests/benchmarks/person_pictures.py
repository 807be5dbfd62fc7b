"""People with drawn poses, gestures and clothes in a world, and pictures of them by the camera of Spot's hand."""

import math

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from executive.app.prepare.worlds import open_world
from executive.words.outlines import inside
from executive.words.variation import DAY_LIGHT
from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.models.catalogue import load_catalogue
from plant.models.person_figure import CLOTHES, Figure, shade
from plant.people.ground import Ground
from plant.rendering import render_parameters
from plant.robots.sensor_suite import Camera
from plant.robots.spot.kind import CAMERAS
from plant.sensors.camera_spec import load_cameras
from skills.robot import FrameTree

WORLD, DISTANCES_M, CAMERA_M, BEHIND_M, TRIES = "home", (1.75, 2.55), 1.0, 0.55, 2000
SIDES_RAD = ((-1.25, -0.6), (-0.35, 0.35), (0.6, 1.25))
CLEAR_M, PERSON_CLEAR_M, AWAY_M = 0.4, 0.45, 0.15
GESTURES = ("none", "waving", "raising_left_arm", "raising_right_arm", "pointing_left", "pointing_right")
POSTURES = {"standing": 0.5, "sitting": 0.3, "lying": 0.2}


def person_of(seed, world):
    """Figure and pose (x, y, yaw, z) of the person of a seed."""
    rng = np.random.default_rng([seed, 90])
    posture = str(rng.choice(list(POSTURES), p=list(POSTURES.values())))
    colour = list(CLOTHES)[int(rng.integers(len(CLOTHES)))]
    gesture = "none" if posture == "lying" else GESTURES[int(rng.integers(len(GESTURES)))]
    figure = Figure(posture, gesture, shade(colour, rng), float(rng.uniform(0.0, math.tau)))
    spots = [spot for rule in world.seed_rules.people for spot in rule.stands if spot.posture == posture]
    return rng, figure, colour, spots


def viewpoints(rng, ground, world, at, yaw_rad, posture):
    """Camera positions (x, y) from three sides at two distances; None when they are not all free."""
    room = next(outline for outline in world.rooms.values() if inside(outline, at))
    sides = SIDES_RAD if posture == "standing" else [(-1.3, 1.3)] * 3 if posture == "sitting" else [(-2.0, 2.0)] * 3
    found = []
    for distance_m in DISTANCES_M:
        for low_rad, high_rad in sides:
            for _ in range(30):
                away_m, bearing_rad = (
                    distance_m + rng.uniform(-AWAY_M, AWAY_M),
                    yaw_rad + rng.uniform(low_rad, high_rad),
                )
                step = np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
                camera, body = at + away_m * step, at + (away_m + BEHIND_M) * step
                if all(inside(room, each) for each in (camera, body)) and ground._clear_m(body[None])[0] > CLEAR_M:
                    found.append(camera)
                    break
            else:
                return None
    return found


def scene_of(seed):
    """Diagram of the world with the person, the truth by trait, the person's place, and the camera positions."""
    world = open_world(WORLD)
    rng, figure, colour, spots = person_of(seed, world)
    empty = build_diagram(DiagramConfig(directives=world.directives_path, render=False))
    ground = Ground.from_plant(empty.plant, empty.scene_graph.model_inspector(), world.corners)
    (x0, y0), (x1, y1) = np.min(world.corners, axis=0), np.max(world.corners, axis=0)
    for _ in range(TRIES):
        if figure.posture == "standing":
            at, yaw_rad, z_m = np.array([rng.uniform(x0, x1), rng.uniform(y0, y1)]), rng.uniform(-math.pi, math.pi), 0.0
            if ground._clear_m(at[None])[0] < PERSON_CLEAR_M:
                continue
        else:
            spot = spots[int(rng.integers(len(spots)))]
            at, yaw_rad, z_m = np.array([spot.x, spot.y]), spot.yaw, spot.z_m
        if not any(inside(outline, at) for outline in world.rooms.values()):
            continue
        if (cameras := viewpoints(rng, ground, world, at, yaw_rad, figure.posture)) is not None:
            break
    else:
        raise RuntimeError(f"no free views of a {figure.posture} person")
    built = built_with([person_model(figure, at, yaw_rad, z_m)], world.directives_path)
    truth = {"pose": figure.posture, "gesture": figure.gesture, "clothes_colour": colour}
    return built, truth, at, cameras, rng


def figure_of(posture, gesture, colour):
    """Figure of a person in a colour of clothes."""
    return Figure(posture, gesture, CLOTHES[colour])


def person_model(figure, at_W, yaw_rad=0.0, z_m=0.0):
    """Model of a person at a place."""
    path = load_catalogue()["person"].forms["standing"].path()
    X_WP = RigidTransform(RotationMatrix.MakeZRotation(yaw_rad), [*at_W, z_m])
    return LooseModel("person", path, X_WP, fixed=True, figure=figure)


def built_with(models, directives=None):
    """Diagram of models in daylight, in a world or in nothing."""
    return build_diagram(DiagramConfig(directives, models, renderer_parameters=render_parameters(DAY_LIGHT)))


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
