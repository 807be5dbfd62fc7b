"""The worlds of our own fit the robot: doors, free poses, heights of surfaces, maps that agree with the shapes."""

from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from pydrake.systems.analysis import Simulator

from errand_train.worlds.__main__ import build
from errand_train.worlds.plan import PLANS, load_plan
from executive.tree.nodes.door_check import view_of
from executive.words.knowledge import load_knowledge
from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.worlds.seeding import place_objects, place_people
from plant.worlds.world import PACKAGE_NAME, known_worlds, load_world

FOOTPRINT_M = (1.1, 0.6)  # the standing outline of 1.0 by 0.5 with 5 cm around
FREE, UNKNOWN, OCCUPIED = 254, 205, 0


class Map:
    """A map_server grid, read on its own here."""

    def __init__(self, path):
        self.header: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
        picture = cv2.imread(str(path.parent / self.header["image"]), cv2.IMREAD_GRAYSCALE)
        assert picture is not None
        self.cells = picture[::-1]

    def at(self, points):
        index = np.floor((points - self.header["origin"][:2]) / self.header["resolution"]).astype(int)
        return self.cells[index[..., 1], index[..., 0]]


@pytest.fixture(scope="module", params=PLANS)
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


def test_every_plan_is_a_world_that_comes_with_the_project():
    assert known_worlds() == tuple(sorted(PLANS))


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


CLOSED = [(name, door) for name in PLANS for door in load_plan(name).doors if not door.open]


@pytest.mark.parametrize(("name", "door"), CLOSED, ids=[f"{name}-{door.name}" for name, door in CLOSED])
def test_every_door_is_as_wide_as_planned_and_free_on_both_sides(name, door):
    keepout, width = Map(load_world(name).surveyed.keepout_map_path), load_plan(name).width_m(door)
    across = np.array([0.0, 1.0]) if door.along_x else np.array([1.0, 0.0])
    along, middle = across[::-1], np.array([door.x, door.y])
    line = middle + np.arange(-width / 2 - 0.1, width / 2 + 0.1, 0.005)[:, None] * along
    assert np.sum(keepout.at(line) == FREE) * 0.005 == pytest.approx(width, abs=0.03)
    reach, half = 0.65 if name == "lab" else 1.05, width / 2 - 0.02  # the lab's corridors are narrow
    lines = middle + np.arange(-half, half, 0.01)[:, None] * along
    assert np.all(keepout.at(lines + np.arange(-reach, reach, 0.01)[:, None, None] * across) == FREE)


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
    for point in rng.uniform([0.0, 0.0], load_plan(world.name).outline_m, (400, 2)):
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
    x, y = load_plan(world.name).outline_m
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


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.nightly] * (name != "flat")) for name in PLANS])
def test_committed_world_is_what_the_builder_writes(name, tmp_path, monkeypatch):
    monkeypatch.setattr("errand_train.worlds.__main__.save_png", lambda *_: None)  # its bytes are the library's
    world = load_world(name)
    build(load_plan(world.name), tmp_path, f"{PACKAGE_NAME}/worlds/{world.name}")
    written = [p for p in tmp_path.rglob("*") if p.suffix in (".sdf", ".obj", ".mtl", ".yaml", ".pgm")]
    assert len(written) > 3 * len(load_plan(world.name).furniture)
    for path in written:
        assert (world.folder / path.relative_to(tmp_path)).read_bytes() == path.read_bytes(), path.name


def test_a_way_of_more_than_a_hundred_metres_leads_around_the_rooms_of_the_lab():
    plan = load_plan("lab")
    corridors = {room.name: room.inside for room in plan.rooms if room.name.endswith(("corridor", "passage"))}
    assert all(0.8 <= min(x1 - x0, y1 - y0) <= 1.2 + 1e-9 for x0, y0, x1, y1 in corridors.values())
    middles = {name: ((x0 + x1) / 2, (y0 + y1) / 2) for name, (x0, y0, x1, y1) in corridors.items()}
    along_x = middles["east corridor"][0] - middles["west corridor"][0]
    along_y = middles["north corridor"][1] - middles["south corridor"][1]
    assert 2 * (along_x + along_y) > 100
    assert all(0.75 <= plan.width_m(door) <= 0.9 for door in plan.doors if not door.open)
