"""`errand world`, and `errand run` in what it makes."""

import math
from itertools import combinations
from pathlib import Path

import cv2
import pytest
import shapely

from errand_make.worlds.furnish import with_entry
from executive import check, load_world
from executive.app.runs.simulated import simulate
from executive.words.knowledge import load_knowledge
from plant.worlds.seeding import place_people
from tests.executive.cli.calls import done, errand, json_of, refusal


def test_a_goal_is_reached_in_a_world_made_of_a_map(map_file, tmp_path):
    made = done("world", "from-map", map_file, "--out", tmp_path / "hall")
    assert ": 1 room, 0 doors, start at" in made.stdout
    done("world", "show", tmp_path / "hall", "--out", tmp_path / "hall.png")
    assert cv2.imread(str(tmp_path / "hall.png")).shape[1] == 1400
    goal = ("--set", "x=4.6", "--set", "y=1.6", "--set", "yaw=0.3", "--start", 3.6, 1.6, 0.3)
    out = ("--out", tmp_path / "out", "--no-record", "--quiet", "--json")
    ran = done("run", "go_to_pose", "--world", tmp_path / "hall", *goal, *out)
    report = json_of(ran)
    assert report["referee"]["success"] and report["referee"]["collisions"] == 0
    assert report["sim_time_s"] < 8.0  # from the start that was given, a metre away


def lying(world, seed):
    """Class and surface of each object that the seed lays in the plant of a world, by name."""
    simulation = simulate(world, {}, seed=seed, record=False)
    simulation.clock.advance(1.0)
    tops = {name: shapely.Polygon(top.polygon_W) for name, top in world.surfaces.items()}
    found = {}
    for name, each in simulation.referee.objects.items():
        x, y, z = each.rests_W[-1]
        (surface,) = (top for top, outline in tops.items() if outline.contains(shapely.Point(x, y)))
        assert 0.0 < z - world.surfaces[surface].height_m < 0.2
        found[name] = each.class_name, surface
    return found


def add(*words):
    added = done("world", "add", *words)
    return added.stdout


def test_a_world_of_a_map_has_a_person_and_a_dock_unless_they_are_not_wanted(own, tmp_path):
    facts = load_world(str(own))
    assert (facts.dock is not None, [person.name for person in facts.seed_rules.people]) == (True, ["Robin"])
    bare = ("world", "from-map", tmp_path / "room.yaml", "--out", tmp_path / "bare", "--no-dock", "--person", "")
    done(*bare)
    assert (load_world(str(tmp_path / "bare")).dock, (tmp_path / "bare" / "objects.yaml").exists()) == (None, False)


def test_a_room_gets_its_name_in_all_facts(own):
    add("room", own, "den", "--in", "room 1")
    knowledge = load_knowledge(own / "knowledge.yaml")
    assert "den" in knowledge.places and "room 1" not in (own / "knowledge.yaml").read_text()
    assert "den" in knowledge.doors[0].between
    assert "there is a 'den' already" in refusal("world", "add", "room", own, "den", "--in", "room 2")


def test_a_named_pose_is_a_place_to_go_to_and_no_room(own):
    assert add("place", own, "pump", "--at", 3.5, 1.5, 1.57).endswith("pump at (3.50, 1.50, 1.57)\n")
    knowledge = load_knowledge(own / "knowledge.yaml")
    assert (knowledge.poses, set(knowledge.rooms)) == (("pump",), {"room 1", "room 2"})
    checked = check("go to the pump", world=str(own))
    assert checked.ok
    assert [str(command) for command in checked.trees[0].commands] == [
        "Take [Nothing] to [pump] and do [Nothing] to [Nothing]"
    ]


def test_a_named_pose_without_space_for_the_body_is_refused(own_table):
    (surface,) = load_knowledge(own_table / "knowledge.yaml").surfaces.values()
    x, y = surface.polygon[0]
    view = surface.viewpoints[0]
    x, y = (0.65 * x + 0.35 * view.x, 0.65 * y + 0.35 * view.y)
    assert "body stands in an obstacle" in refusal("world", "add", "place", own_table, "pump", "--at", x, y, view.yaw)


def test_a_blocked_pose_of_the_file_does_not_keep_additions_out(own_table):
    file = own_table / "knowledge.yaml"
    (surface,) = load_knowledge(file).surfaces.values()
    view = surface.viewpoints[0]
    ahead = (view.x + 0.4 * math.cos(view.yaw), view.y + 0.4 * math.sin(view.yaw))
    pose = {"x": round(ahead[0], 3), "y": round(ahead[1], 3), "yaw": view.yaw}
    file.write_text(with_entry(file, "places", "pump", {"pose": pose}), encoding="utf-8")
    done("world", "add", "person", own_table, "Kim", "--in", "room 2")


def test_a_name_that_no_sentence_can_say_is_warned_of(own):
    added = done("world", "add", "place", own, "#", "--at", 3.5, 1.5, 1.57)
    assert "knowledge.yaml" in added.stderr and "places.#: no sentence can say this name" in added.stderr


def test_one_name_for_two_parts_of_a_world_is_warned_of(own):
    add("place", own, "Kim", "--at", 3.5, 1.5, 1.57)
    told = "people.Kim: places.Kim has the same name"
    assert told in done("world", "add", "person", own, "Kim").stderr
    assert told in done("world", "check", own).stderr
    added = done("world", "add", "place", own, "alice", "--at", 3, 1.5, 0)
    assert "the robot 'Alice' has the same name" in added.stderr


def test_a_further_object_of_a_model_has_a_number(own):
    add("table", own, "bench", "--in", "room 1")
    said = [add("object", own, "beer", "--on", "bench") for _ in range(3)]
    assert [each.strip().partition(": ")[2] for each in said] == [
        "beer on the bench", "beer on the bench, as 'beer_2'", "beer on the bench, as 'beer_3'",
    ]  # fmt: skip
    assert {name: model for name, (model, _) in lying(load_world(str(own)), 1).items()} == {
        "beer": "beer", "beer_2": "beer", "beer_3": "beer",
    }  # fmt: skip


@pytest.mark.parametrize("kind", ["table", "desk", "shelf"])
def test_furniture_stands_at_a_wall_and_the_robot_finds_an_object_on_it(own, kind):
    add(kind, own, "big one", "--in", "room 1")
    add("object", own, "coke", "--on", "big one")
    knowledge, world = load_knowledge(own / "knowledge.yaml"), load_world(str(own))
    top = knowledge.surfaces["big one"]
    assert (top.place, len(top.viewpoints)) == ("room 1", 1)
    assert knowledge.usual_surfaces("drink") == ("big one",)
    assert lying(world, 3) == {"coke": ("coke", "big one")}
    for sentence in ("fetch me a coke", "go to the big one"):
        assert check(sentence, world=str(own)).ok


def test_furniture_is_on_the_map_at_the_heights_of_its_parts(own):
    add("table", own, "table", "--at", 5.0, 3.8, -1.5708, "--size", 1.2, 0.6, 0.6)
    keepout, scan = (cv2.imread(str(own / "map" / f"{name}.pgm"), cv2.IMREAD_GRAYSCALE) for name in ("keepout", "scan"))
    row, column = 120 - round((3.8 + 1.0) / 0.05), round((5.0 - 2.0) / 0.05)
    assert (keepout[row, column], scan[row, column]) == (0, 254)  # the top is below the band of the LiDAR


def test_two_pieces_two_people_and_comments_stand_together_in_the_files(own):
    file = own / "knowledge.yaml"
    file.write_text("# mine\n" + file.read_text())
    for words in (("table", own, "one"), ("desk", own, "two", "--in", "room 2"), ("person", own, "Kim")):
        add(*words)
    knowledge = load_knowledge(file)
    assert (set(knowledge.surfaces), set(knowledge.people)) == ({"one", "two"}, {"Robin", "Kim"})
    assert file.read_text().startswith("# mine\n")
    assert len(load_world(str(own)).seed_rules.fronts) == 2


def places(world, seed):
    """Point and room of each person, as the seed places them."""
    facts = load_world(str(world))
    points = {each.name: each.X_WO.translation()[:2].tolist() for each in place_people(facts, seed)}
    rooms = {name: shapely.Polygon(outline) for name, outline in facts.rooms.items()}
    return {
        name: (at, next(room for room, outline in rooms.items() if outline.contains(shapely.Point(at))))
        for name, at in points.items()
    }


def test_people_without_a_place_stand_apart_before_the_start_and_then_in_its_room(own):
    said = [add("person", own, name) for name in ("Kim", "Noor", "Ada")]
    assert ["beside the robot's start" in each for each in said] == [True, True, False]
    for seed in range(20):
        stood = places(own, seed)
        assert min(math.dist(a, b) for (a, _), (b, _) in combinations(stood.values(), 2)) > 0.9
        assert {room for _, room in stood.values()} == {"room 1"}


def test_a_person_stands_in_a_room_at_a_pose_or_near_a_place(own_table):
    add("place", own_table, "pump", "--at", 12.0, 2.5, 0.0)
    add("person", own_table, "Eve", "--in", "room 2")
    add("person", own_table, "Max", "--near", "pump")
    assert "Zoe stands in the room 1 at (3.50, 3.50, 0.00)" in add("person", own_table, "Zoe", "--at", 3.5, 3.5, 0.0)
    stood = places(own_table, 0)
    assert (stood["Eve"][1], stood["Max"][1], stood["Zoe"][0]) == ("room 2", "room 2", [3.5, 3.5])
    assert 1.0 < math.dist(stood["Max"][0], (12.0, 2.5)) < 1.6
    assert {name: each.at for name, each in load_knowledge(own_table / "knowledge.yaml").people.items()} == {
        "Robin": "room 1", "Eve": "room 2", "Max": "room 2", "Zoe": "room 1"
    }  # fmt: skip


def test_a_person_near_a_surface_does_not_stand_from_where_the_robot_looks_at_it(own_table):
    (view,) = load_knowledge(own_table / "knowledge.yaml").surfaces["table"].viewpoints
    add("person", own_table, "Pat", "--near", "table")
    assert 0.5 < math.dist(places(own_table, 0)["Pat"][0], (view.x, view.y)) < 2.0
    assert "from where it looks" in refusal("world", "add", "person", own_table, "Kim", "--at", view.x, view.y, 0.0)


def test_nothing_is_put_where_a_person_stands(own):
    add("person", own, "Zoe", "--at", 3.5, 3.5, 0.0)
    files = {file: file.read_bytes() for file in own.rglob("*.yaml")}
    for words in (("person", own, "Tim", "--at", 3.6, 3.8, 0.0), ("table", own, "bar", "--at", 3.5, 3.5, 0.0)):
        assert "Zoe stands there" in refusal("world", "add", *words)
    assert {file: file.read_bytes() for file in own.rglob("*.yaml")} == files


def test_a_world_in_which_people_overlap_is_drawn_and_refused(own, tmp_path):
    done("world", "check", own)
    file = own / "objects.yaml"
    file.write_text(file.read_text() + "  - {name: Kim, route: {waypoints: [[2.2, 1.0]]}}\n")
    assert "Kim would stand in walls at (2.20, 1.00)" in refusal("world", "check", own)
    assert "objects.yaml:11: Kim would stand in walls" in refusal("world", "show", own, "--out", tmp_path / "own.png")
    assert (tmp_path / "own.png").is_file()


def test_the_check_of_a_world_refuses_places_that_furniture_or_a_person_blocks(own_table):
    file = own_table / "knowledge.yaml"
    before, (surface,) = file.read_text(), load_knowledge(file).surfaces.values()
    view = surface.viewpoints[0]
    x, y = 0.65 * surface.polygon[0][0] + 0.35 * view.x, 0.65 * surface.polygon[0][1] + 0.35 * view.y
    file.write_text(with_entry(file, "places", "pump", {"pose": {"x": x, "y": y, "yaw": view.yaw}}))
    assert "the robot's body stands in an obstacle" in refusal("world", "check", own_table)
    file.write_text(before)
    done("world", "check", own_table)
    pose = load_knowledge(file).place_pose("room 2")
    people = own_table / "objects.yaml"
    kim = f"people:\n  - {{name: Kim, pose: {{x: {pose.x}, y: {pose.y}, yaw: 0.0}}}}\n"
    people.write_text(people.read_text().replace("people:\n", kim))
    assert "places.room 2" in (said := refusal("world", "check", own_table)) and "touches Kim" in said


def zone(*words):
    return errand("world", "zone", *words)


def test_zones_are_added_listed_and_removed_and_comments_stay(own):
    file = own / "knowledge.yaml"
    before = f"# mine\n{file.read_text()}"
    file.write_text(before)
    slow = ("--kind", "speed_limit", "--polygon", "3 0, 5 0, 5 2", "--speed", 0.3)
    assert zone("add", own, "slow", *slow).stdout.endswith("at most 0.3 m/s in: slow\n")
    assert zone("add", own, "private", "--kind", "keep_out", "--in", "room 2").exit_code == 0
    assert set(zone("list", own).stdout.splitlines()) == {"at most 0.3 m/s in: slow", "keep out of: private"}
    zones = load_knowledge(file).zones
    assert (zones["slow"].polygon, zones["private"].place) == (((3.0, 0.0), (5.0, 0.0), (5.0, 2.0)), "room 2")
    assert file.read_text().startswith("# mine\n")
    (error,) = check("go to room 2", world=str(own)).errors
    assert error.message.startswith("The private is a keep-out zone.")
    for name in ("slow", "private"):
        assert zone("remove", own, name).exit_code == 0
    assert file.read_text().rstrip() == before.rstrip()


def test_a_filter_mask_in_the_folder_of_a_world_becomes_a_zone(own, map_file):
    for name in ("room.yaml", "room.pgm"):
        (own / name).write_bytes((map_file.parent / name).read_bytes())
    added = zone("add", own, "walls", "--kind", "keep_out", "--mask", own / "room.yaml")
    assert added.exit_code == 0, added.output
    (made,) = load_knowledge(own / "knowledge.yaml").known_zones()
    assert Path(made.mask.file) == own / "room.yaml"


def test_a_zone_in_one_line_with_others_is_not_removed(own):
    file = own / "knowledge.yaml"
    file.write_text(
        f"{file.read_text()}zones: {{a: {{kind: silent, place: room 1}}, b: {{kind: silent, place: room 2}}}}\n"
    )
    before = file.read_text()
    refused = zone("remove", own, "a")
    assert (refused.exit_code, "in a form that cannot be changed" in refused.stderr) == (2, True), refused.output
    assert file.read_text() == before


def test_an_imported_model_is_added_and_imported_by_the_world(own, mesh, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    add("table", own, "rack")
    for name in ("drill", "saw"):
        done("object", "import", mesh, "--name", name)
        assert add("object", "own", name, "--on", "rack") == f"own: {name} on the rack\n"
    world = load_world(str(own))
    assert {name: each.folder for name, each in world.imports.items()} == {n: tmp_path / n for n in ("drill", "saw")}
    assert lying(world, 1) == {"drill": ("drill", "rack"), "saw": ("saw", "rack")}
    assert check("fetch me the drill", world="own").ok
    hint = "there are beer, coke, extinguisher, hammer, screwdriver, wrench, person, cylinder, cube, saw and drill"
    assert hint in refusal("world", "add", "object", "own", "rocket", "--on", "rack")


def test_a_model_of_a_known_class_is_added_under_its_own_name(own, mesh, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    add("table", own, "rack")
    done("object", "import", mesh, "--name", "my_wrench", "--class", "wrench")
    add("object", "own", "my_wrench", "--on", "rack")
    assert lying(load_world(str(own)), 1) == {"my_wrench": ("wrench", "rack")}
    assert load_knowledge(own / "knowledge.yaml").usual_surfaces("wrench") == ("rack",)


def test_a_missing_folder_of_worlds_is_refused(tmp_path):
    refused = errand("world", "list", tmp_path / "extra")
    assert (refused.exit_code, "extra: there is no such folder" in refused.stderr) == (2, True)


def test_worlds_are_listed_with_rooms_and_robots(own, tmp_path):
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "world.dmd.yaml").write_text("directives: []\n")
    listed = done("world", "list", tmp_path)
    lines = {words[0]: " ".join(words[1:]) for words in map(str.split, listed.stdout.splitlines())}
    assert [*lines][:4] == ["world", "flat", "lab", "shop"]  # then those of plug-ins
    assert [*lines][-1] == str(own)
    assert lines["flat"].startswith("12 x 9 12 Alice (spot) Robin hall, kitchen, living room")
    assert lines[str(own)].endswith("0 Alice (spot) Robin room 1, room 2")
    assert f"warning: {tmp_path / 'broken' / 'knowledge.yaml'}: there is no such file" in listed.stderr


BUILDING = """
name: two rooms
levels:
  L1:
    vertices: [[0, 0, 0, ""], [200, 0, 0, ""], [200, 80, 0, ""], [0, 80, 0, ""], [30, 40, 0, store], [80, 40, 0, desk]]
    walls: [[0, 1, {}], [1, 2, {}], [2, 3, {}], [3, 0, {}]]
    lanes: [[4, 5, {bidirectional: [4, true]}]]
"""


def test_a_building_of_open_rmf_becomes_a_world_to_drive_in(tmp_path):
    file = tmp_path / "own.building.yaml"
    file.write_text(BUILDING)
    built = done("world", "from-map", file, "--out", tmp_path / "own", "--no-dock", "--person", "", "--scale", 0.04)
    assert ": 1 room, 0 doors, start at 1.20 -1.60" in built.stdout and built.stderr == ""
    out = ("--out", tmp_path / "out", "--no-record", "--quiet", "--json")
    ran = done("run", "--say", "go to the desk", "--world", tmp_path / "own", *out)
    assert json_of(ran)["referee"]["success"] and json_of(ran)["referee"]["collisions"] == 0


def test_a_name_of_a_building_that_no_sentence_can_say_is_warned_of(tmp_path):
    file = tmp_path / "own.building.yaml"
    file.write_text(BUILDING.replace("desk", "please"))
    built = done("world", "from-map", file, "--out", tmp_path / "own", "--no-dock", "--person", "", "--scale", 0.04)
    assert "places.please: no sentence can say this name" in built.stderr


def test_options_of_a_building_are_refused_for_another_map(map_file, tmp_path):
    said = refusal("world", "from-map", map_file, "--out", tmp_path / "hall", "--level", "L1")
    assert "--level and --scale are for a building of Open-RMF" in said
