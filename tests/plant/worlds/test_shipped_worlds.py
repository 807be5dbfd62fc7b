"""The worlds of our own fit the robot: doors, free poses, heights of surfaces, maps that agree with the shapes."""

import cv2
import numpy as np
import pytest
import yaml
from pydrake.systems.analysis import Simulator

from executive.tree.nodes.door_check import view_of
from executive.words.knowledge import load_knowledge
from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.worlds.seeding import place_objects, place_people
from plant.worlds.world import load_world
from tests.plant.worlds.plain_map import FREE, OCCUPIED, UNKNOWN, Map
from tests.project import shipped_worlds

FOOTPRINT_M = (1.1, 0.6)  # the standing outline of 1.0 by 0.5 with 5 cm around
OUTLINES_M = {"flat": (12.0, 9.0), "shop": (18.0, 13.0), "lab": (37.0, 18.0)}
"""Sides of the worlds."""


@pytest.fixture(scope="module", params=OUTLINES_M)
def world(request):
    return load_world(request.param)


@pytest.fixture(scope="module")
def knowledge(world):
    return dict(yaml.safe_load(world.knowledge_path.read_text(encoding="utf-8")))


@pytest.fixture(scope="module")
def keepout(world):
    return Map(world.surveyed.keepout_map_path)


@pytest.fixture(scope="module")
def furnished(world):
    """The world in the plant, with all objects and people of seed 1."""
    objects = [LooseModel(each.name, each.model_path, each.X_WO) for each in place_objects(world, 1)]
    people = [LooseModel(each.name, each.model_path, each.X_WO, fixed=True) for each in place_people(world, 1)]
    config = DiagramConfig(directives=world.directives_path, models=[*objects, *people], visuals=False, render=False)
    diagram = build_diagram(config).diagram
    return diagram, diagram.CreateDefaultContext()


def query(diagram, context):
    scene_graph = diagram.GetSubsystemByName("scene_graph")
    return scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))


def footprint(pose, size=FOOTPRINT_M):
    x, y = (np.arange(-length / 2, length / 2 + 1e-9, 0.0125) for length in size)
    local = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    c, s = np.cos(pose["yaw"]), np.sin(pose["yaw"])
    return local @ np.array([[c, s], [-s, c]]) + [pose["x"], pose["y"]]


def known_poses(knowledge):
    poses = {"start": knowledge["start"], "dock": knowledge["dock"]}
    poses |= {name: place["pose"] for name, place in knowledge["places"].items()}
    for name, surface in knowledge["surfaces"].items():
        poses |= {f"{name} {i}": pose for i, pose in enumerate(surface["viewpoints"])}
    return poses


def test_these_worlds_come_with_the_project():
    assert shipped_worlds() == tuple(sorted(OUTLINES_M))


def test_every_known_pose_is_free(knowledge, keepout):
    taken = [name for name, pose in known_poses(knowledge).items() if np.any(keepout.at(footprint(pose)) != FREE)]
    assert taken == []


def test_every_room_has_a_free_circle_to_turn_in(knowledge, keepout):
    radius = cv2.distanceTransform((keepout.cells == FREE).astype(np.uint8), cv2.DIST_L2, 5)
    x = (np.arange(keepout.cells.shape[1]) + 0.5) * keepout.header["resolution"] + keepout.header["origin"][0]
    y = (np.arange(keepout.cells.shape[0]) + 0.5) * keepout.header["resolution"] + keepout.header["origin"][1]
    for name, place in knowledge["places"].items():
        low, high = np.min(place["polygon"], axis=0), np.max(place["polygon"], axis=0)
        if name.endswith(("corridor", "passage", "aisle", "aisle one", "aisle two", "aisle three")):
            continue  # ways, in which there need be none
        window = np.ix_((y > low[1]) & (y < high[1]), (x > low[0]) & (x < high[0]))
        assert 2 * radius[window].max() * keepout.header["resolution"] >= 1.5, name


def test_from_before_every_door_it_is_seen_from_a_free_pose(world, keepout):
    knowledge = load_knowledge(world.knowledge_path)
    for door in knowledge.doors:
        views = [view for room in door.between if (view := view_of(knowledge, door, room)) is not None]
        poses = [{"x": view.x_m, "y": view.y_m, "yaw": view.yaw_rad} for view in views]
        lines = [np.linspace([view.x_m, view.y_m], door.at, 100) for view in views]
        seen = [np.vstack([footprint(pose), line]) for pose, line in zip(poses, lines, strict=True)]
        assert any(np.all(keepout.at(points) == FREE) for points in seen), door


def test_rooms_hang_together(knowledge, keepout):
    resolution = keepout.header["resolution"]
    passable = cv2.erode((keepout.cells == FREE).astype(np.uint8), np.ones((2 * int(0.31 / resolution) + 1,) * 2))
    _, parts = cv2.connectedComponents(passable)
    centres = np.array([(p["pose"]["x"], p["pose"]["y"]) for p in knowledge["places"].values()])
    index = np.floor((centres - keepout.header["origin"][:2]) / resolution).astype(int)
    (label,) = set(parts[index[:, 1], index[:, 0]])
    assert label != 0


def test_known_places_hold_their_poses_and_surfaces(knowledge):
    places = {name: np.array(place["polygon"], dtype=np.float32) for name, place in knowledge["places"].items()}
    inside = [(name, (p["pose"]["x"], p["pose"]["y"])) for name, p in knowledge["places"].items()]
    for surface in knowledge["surfaces"].values():
        inside += [(surface["place"], tuple(corner)) for corner in surface["polygon"]]
        inside += [(surface["place"], (v["x"], v["y"])) for v in surface["viewpoints"]]
    for name, point in inside:
        assert cv2.pointPolygonTest(places[name], point, False) >= 0, (name, point)


def test_viewpoints_face_their_surface_from_the_right_distance(knowledge):
    for name, surface in knowledge["surfaces"].items():
        polygon = np.array(surface["polygon"], dtype=np.float32)
        for view in surface["viewpoints"]:
            distance = -cv2.pointPolygonTest(polygon, (view["x"], view["y"]), True)
            assert 0.85 <= distance <= 1.0, name
            ahead = (distance + 0.1) * np.array([np.cos(view["yaw"]), np.sin(view["yaw"])])
            assert cv2.pointPolygonTest(polygon, tuple(ahead + [view["x"], view["y"]]), False) > 0, name


def test_surfaces_are_solid_and_flat_at_their_heights(world, knowledge, furnished):
    query_object = query(*furnished)
    things = [t.X_WO.translation() for t in place_objects(world, 1)]
    for name, surface in knowledge["surfaces"].items():
        low, high = np.min(surface["polygon"], axis=0), np.max(surface["polygon"], axis=0)
        if surface.get("bin"):
            middle, rim = np.array([*(low + high) / 2, 0.0]), np.array([low[0] + 0.01, low[1] + 0.01, 0.0])
            near = query_object.ComputeSignedDistanceToPoint
            assert not near(middle + [0, 0, 0.1], 0.0) and near(middle + [0, 0, 0.05], 0.0), name
            assert near(rim + [0, 0, surface["height"] - 0.01], 0.0), name
            continue
        for x in np.linspace(low[0] + 0.03, high[0] - 0.03, 7):
            for y in np.linspace(low[1] + 0.03, high[1] - 0.03, 4):
                if any(np.hypot(x - t[0], y - t[1]) < 0.25 for t in things):
                    continue
                near = query_object.ComputeSignedDistanceToPoint
                assert near(np.array([x, y, surface["height"] - 0.01]), 0.0), (name, x, y)
                assert not near(np.array([x, y, surface["height"] + 0.01]), 0.005), (name, x, y)


@pytest.mark.parametrize("name", ["scan", "keepout"])
def test_maps_agree_with_the_collision_shapes(name, world, furnished):
    grid, query_object = Map(world.folder / "truth" / f"{name}.yaml"), query(*furnished)
    moving = [p.X_WO.translation()[:2] for p in (*place_objects(world, 1), *place_people(world, 1))]
    rng, (z0, z1) = np.random.default_rng(5), grid.header["height_band_m"]
    occupied = 0
    for point in rng.uniform([0.0, 0.0], OUTLINES_M[world.name], (400, 2)):
        if min(np.linalg.norm(point - m) for m in moving) < 0.5:
            continue
        depth = min(distance_m(query_object, point, z) for z in np.arange(z0 + 0.01, z1, 0.03))
        if depth < -0.015:
            assert grid.at(point) == OCCUPIED, point
            occupied += 1
        elif depth > 0.015:
            assert grid.at(point) == FREE, point
    assert occupied > 10


def distance_m(query_object, point, z):
    """Horizontal reach is enough: the nearest shape within 5 cm, else 1."""
    found = query_object.ComputeSignedDistanceToPoint(np.array([*point, z]), 0.03)
    return min((f.distance for f in found), default=1.0)


def test_outside_of_the_walls_is_unknown(world, keepout):
    x, y = OUTLINES_M[world.name]
    assert np.all(keepout.at(np.array([(-0.3, y / 2), (x + 0.3, y / 2), (x / 2, y + 0.3), (x / 2, -0.3)])) == UNKNOWN)


def test_the_coffee_table_is_for_the_body_and_not_for_the_lidar(world, keepout):
    middle = np.mean(world.surfaces["coffee table"].polygon_W, axis=0)
    assert (keepout.at(middle), Map(world.surveyed.scan_map_path).at(middle)) == (OCCUPIED, FREE)


def test_people_and_things_are_not_surveyed(world, keepout):
    for seed in range(10):
        for one in place_people(world, seed):
            around = {"x": one.X_WO.translation()[0], "y": one.X_WO.translation()[1], "yaw": 0.0}
            assert np.all(keepout.at(footprint(around, (1.4, 1.4))) == FREE), one.name


def test_things_lie_where_the_robot_is_told_that_they_usually_are(world, knowledge):
    for seed in range(10):
        for thing in place_objects(world, seed):
            assert thing.surface in knowledge["things"][thing.class_name]["usual"]


def test_things_stay_where_the_seed_put_them(world, furnished):
    diagram, context = furnished
    simulator = Simulator(diagram, context.Clone())
    simulator.AdvanceTo(1.0)
    plant = diagram.GetSubsystemByName("plant")
    now = plant.GetMyContextFromRoot(simulator.get_context())
    for thing in place_objects(world, 1):
        X_WO = plant.EvalBodyPoseInWorld(now, plant.GetBodyByName(thing.class_name))
        moved = X_WO.translation() - thing.X_WO.translation()
        assert np.linalg.norm(moved[:2]) < 1e-3 and moved[2] == pytest.approx(-0.001, abs=5e-4)
