"""Worlds made of building files of Open-RMF's traffic editor; the files here are our own."""

import re
from pathlib import Path

import pytest
import yaml

from errand_make.worlds.building import building_grid, building_plan, building_start, is_building, read_building
from errand_make.worlds.own import world_from_grid
from errand_make.worlds.rooms import FREE, OCCUPIED, UNKNOWN
from executive import load_world
from executive.words.knowledge import load_knowledge
from skills.inputs.errors import InputError
from skills.inputs.yaml_source import parse_yaml

# Two rooms of 4 x 3 m side by side, at 0.02 m a pixel, with a door of 1 m in the wall between them.
VERTICES = [(0, 0), (200, 0), (400, 0), (400, 150), (200, 150), (0, 150), (200, 50), (200, 100)]
NAMED = [(100, 75, "west_store"), (300, 75, "charger_1"), (340, 120, "desk")]
WALLS = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0), (1, 6), (7, 4)]


def building(**changes):
    vertices = [[x, y, 0, ""] for x, y in VERTICES]
    vertices += [[x, y, 0, name, {"is_charger": [4, name == "charger_1"]}] for x, y, name in NAMED]
    level = {
        "elevation": 0,
        "drawing": {"filename": "plan.png"},
        "vertices": vertices,
        "walls": [[*ends, {"alpha": [3, 1]}] for ends in WALLS],
        "doors": [[6, 7, {"name": [1, "swing"], "type": [1, "hinged"]}]],
        "floors": [{"parameters": {}, "vertices": [0, 2, 3, 5]}],
        "lanes": [[8, 9, {"bidirectional": [4, True]}], [9, 10, {"bidirectional": [4, False]}]],
        "measurements": [[0, 1, {"distance": [3, 4.0]}]],
        **changes,
    }
    return {"name": "two rooms", "levels": {"L1": level}}


def read(data, *, level=None, scale_m=None):
    source = parse_yaml(yaml.safe_dump(data), Path("a.building.yaml"))
    assert is_building(source)
    return read_building(source, level=level, scale_m=scale_m)


def made(folder, data):
    plan = read(data)
    grid, notes = building_grid(plan), []
    start = building_start(plan, grid)
    world_from_grid(folder, grid, start=start, wall_height_m=2.5, plan=building_plan(plan, notes.append))
    return load_world(str(folder)), load_knowledge(folder / "knowledge.yaml"), notes


def test_rooms_doors_names_and_lanes_come_from_the_building(tmp_path):
    world, known, notes = made(tmp_path, building())
    assert (set(known.rooms), set(known.poses)) == ({"west store", "room 2"}, {"charger 1", "desk"})
    (door,) = known.doors
    assert (set(door.between), door.at, door.width) == ({"west store", "room 2"}, (4.0, -1.5), 1.0)
    assert (world.start.x_m, world.start.y_m) == pytest.approx((6.0, -1.5))
    assert {zone.kind for zone in known.known_zones()} == {"preferred"}
    assert notes == []


def test_walls_are_occupied_floors_free_and_the_ground_about_them_unknown():
    grid = building_grid(read(building()))

    def cell(x, y):
        return int(grid.cells[int((y - grid.origin_m[1]) / 0.05), int((x - grid.origin_m[0]) / 0.05)])

    points = {(1.0, -1.0): FREE, (4.0, -0.5): OCCUPIED, (4.0, -1.5): FREE, (8.0, -1.0): OCCUPIED, (8.5, -1.0): UNKNOWN}
    assert {point: cell(*point) for point in points} == points


def test_the_room_of_a_point_in_a_room_inside_another_is_the_inner_one(tmp_path):
    inner = [(240, 20), (360, 20), (360, 130), (240, 130), (240, 60), (240, 90)]
    vertices = [[x, y, 0, ""] for x, y in [*VERTICES[:6], *inner]] + [[100, 75, 0, "hall"], [300, 75, 0, "cell"]]
    walls = [*WALLS[:6], (6, 7), (7, 8), (8, 9), (9, 11), (10, 6)]
    data = building(vertices=vertices, walls=[[*ends, {}] for ends in walls], doors=[[10, 11, {}]], lanes=[])
    _, known, _ = made(tmp_path, data)
    assert list(known.rooms) == ["cell", "hall"]
    assert set(known.doors[0].between) == {"cell", "hall"}


def test_a_name_that_the_robot_cannot_reach_is_left_out_with_a_note(tmp_path):
    _, known, notes = made(tmp_path, building(doors=[], walls=[[*ends, {}] for ends in [*WALLS, (6, 7)]]))
    assert known.place("west store") is None
    assert notes == ["west store is left out: no pose near it is free and within reach"]


#   what the file has                                            a part of the notes
NOTES = [
    (building(measurements=[]), "no measurement gives its scale: a pixel counts as 0.05 m"),
    (building(models=[{"name": "Sofa"}, {"name": "Sofa"}]), "2 models of the level: left out"),
    (building(), "1 lane of one direction is preferred ground in both"),
    ({**building(), "lifts": {"Lift1": {}}}, "1 lift: left out"),
    (building(walls=[]), "the level L1 has no walls, so nothing bounds or divides its rooms"),
    ({**building(), "levels": {**building()["levels"], "L2": {}}}, "it has the levels L1, L2: L1 is taken"),
]


@pytest.mark.parametrize(("data", "note"), NOTES, ids=[note[:20] for _, note in NOTES])
def test_the_report_names_what_is_not_taken(data, note):
    assert any(note in each for each in read(data).notes)


def test_measurements_that_contradict_each_other_are_named_with_their_scales():
    measured = [[0, 1, {"distance": [3, 4.0]}], [0, 5, {"distance": [3, 9.0]}]]
    plan = read(building(measurements=measured))
    (note,) = (each for each in plan.notes if "contradict" in each)
    assert re.search(r"a pixel is 0.02 m by line \d+, 0.06 m by line \d+; their mean of 0.04 m is taken", note)


def test_measurements_that_differ_by_the_width_of_a_click_are_averaged_silently():
    measured = [[0, 1, {"distance": [3, 4.0]}], [0, 5, {"distance": [3, 3.06]}]]
    assert not any("contradict" in each for each in read(building(measurements=measured)).notes)


def test_the_second_vertex_of_a_name_is_left_out_with_both_lines():
    vertices = building()["levels"]["L1"]["vertices"]
    plan = read(building(vertices=[*vertices, [10, 10, 0, "desk"]]))
    (note,) = (each for each in plan.notes if "'desk'" in each)
    first, second = map(int, re.search(r"lines (\d+) and (\d+) have vertices of the name 'desk'", note).groups())
    assert first < second and plan.names["desk"] == pytest.approx((6.8, -2.4))


def test_metres_need_no_measurement_and_keep_their_signs():
    data = {**building(measurements=[]), "coordinate_system": "cartesian_meters"}
    assert read(data).names["desk"] == (340.0, 120.0)


def storeys(fiducials, **changes):
    """A second level beside the building's first, whose fiducials a and b are at (0, 0) and (8, 0) m."""
    upper = {**building(measurements=[])["levels"]["L1"], "fiducials": fiducials}
    lower = {**building()["levels"]["L1"], "fiducials": [[0, 0, "a"], [400, 0, "b"]]}
    return {**building(), "levels": {"L1": lower, "L2": upper}, **changes}


#   fiducials of the upper level                          where its vertex (340, 120) lies
FRAMES = [
    ([[0, 0, "a"], [400, 0, "b"]], (6.8, -2.4)),
    ([[100, 20, "a"], [300, 20, "b"]], (9.6, -4.0)),
    ([[40, 20, "b"], [40, 420, "a"], [7, 7, "c"]], (6.0, -6.0)),
    ([[0, 0, "a"], [0, 400, "b"]], (2.4, 6.8)),
]


@pytest.mark.parametrize(("fiducials", "desk"), FRAMES)
def test_a_level_is_turned_scaled_and_moved_to_the_fiducials_of_the_reference_level(fiducials, desk):
    plan = read(storeys(fiducials), level="L2")
    assert plan.names["desk"] == pytest.approx(desk) and not any("scale" in note for note in plan.notes)


def test_another_level_may_be_the_reference_level():
    data = storeys([[0, 0, "a"], [0, 400, "b"]], reference_level_name="L2")
    data["levels"]["L2"]["measurements"] = [[0, 1, {"distance": [3, 8.0]}]]
    assert read(data, level="L1").names["desk"] == pytest.approx((-4.8, -13.6))


def test_the_scale_of_an_upper_level_may_be_given():
    assert read(storeys([[100, 20, "a"], [300, 20, "b"]]), level="L2", scale_m=0.1).names["desk"] == pytest.approx(
        (24.0, -10.0)
    )


def test_a_level_with_one_common_fiducial_keeps_the_frame_of_its_drawing():
    plan = read(storeys([[100, 20, "a"], [300, 20, "z"]]), level="L2", scale_m=0.02)
    assert plan.names["desk"] == pytest.approx((6.8, -2.4))
    assert any("has 1 fiducials in common with the reference level L1, and needs 2" in note for note in plan.notes)


#   fiducials of the upper level, changes                             a part of the message
FIDUCIALS = [
    (([[0, 0, "a"], [0, 0, "b"]], {}), "two fiducials of level L2 or L1 are at one point"),
    (([[0, 0], [1, 0, "b"]], {}), r"fiducial 0 is not \[x, y, name\]"),
    (([[0, float("nan"), "a"], [1, 0, "b"]], {}), "fiducial 0 is not"),
    (([], {"reference_level_name": "L9"}), "there is no level 'L9' for the reference"),
]


@pytest.mark.parametrize(("given", "message"), FIDUCIALS, ids=[message[:20] for _, message in FIDUCIALS])
def test_wrong_fiducials_are_refused(given, message):
    fiducials, changes = given
    with pytest.raises(InputError, match=message):
        read(storeys(fiducials, **changes), level="L2")


def test_the_scale_may_be_given():
    assert read(building(measurements=[]), scale_m=0.1).names["desk"] == pytest.approx((34.0, -12.0))


#   a wrong file                                                 a part of the refusal
WRONG = [
    ({**building(), "coordinate_system": "wgs84"}, "of the kind 'wgs84'"),
    (building(walls=[[0, 99, {}]]), "wall 0 names vertex 99, and the level has the vertices 0 to 10"),
    (building(lanes=[[-1, 0, {}]]), "lane 0 names vertex -1"),
    (building(vertices=[], floors=[]), "wall 0 names vertex 0, and the level has no vertices"),
    (building(doors=[[0]]), "door 0 does not begin with the numbers of 2 vertices"),
    (building(floors=[{"vertices": [0, 1, 99]}]), "floor 0 names vertex 99"),
    (building(floors=[{}]), "floor 0 has no list of vertices"),
    (building(vertices=[["a", 0, 0, ""]]), "vertex 0 has no x and y"),
    (building(vertices=[[0, float("nan"), 0, ""]]), "vertex 0 has no x and y"),
    (building(walls=3), "walls is no list"),
    ({"levels": {}}, "the building has no levels"),
    ({"name": "b"}, "the building has no levels"),
    ({"levels": ["L1"]}, "the levels of the building have no names"),
    (None, "the building file is empty"),
    (["L1"], "it is no building of Open-RMF"),
    ({"levels": {"L1": None}}, "has no walls, floors, lanes or names"),
    ({"levels": {"L1": [1]}}, "has no walls, floors, lanes or names"),
]


@pytest.mark.parametrize(("data", "message"), WRONG, ids=[message[:24] for _, message in WRONG])
def test_a_wrong_building_is_refused(data, message):
    with pytest.raises(InputError, match=message) as refused:
        read(data)
    assert refused.value.hint and refused.value.line


def test_a_level_that_is_not_there_is_refused_with_those_that_are():
    with pytest.raises(InputError, match="there is no level 'L7'") as refused:
        read(building(), level="L7")
    assert "L1" in refused.value.hint


def test_a_level_that_is_too_large_is_refused():
    with pytest.raises(InputError, match="too large"):
        building_grid(read(building(), scale_m=5.0))
