"""`errand world`, and `errand run` in what it makes."""

from pathlib import Path

import cv2
import pytest

import executive
from executive.words.knowledge import load_knowledge
from plant.worlds.seeding import place_objects
from plant.worlds.world import load_world
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


def add(*words):
    added = done("world", "add", *words)
    return added.stdout


def test_a_world_of_a_map_has_a_person_and_a_dock_unless_they_are_not_wanted(own, tmp_path):
    facts = load_world(own)
    assert (facts.dock is not None, [person.name for person in facts.seed_rules.people]) == (True, ["Robin"])
    bare = ("world", "from-map", tmp_path / "room.yaml", "--out", tmp_path / "bare", "--no-dock", "--person", "")
    done(*bare)
    assert (load_world(tmp_path / "bare").dock, (tmp_path / "bare" / "objects.yaml").exists()) == (None, False)


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
    checked = executive.check("go to the pump", world=str(own))
    assert checked.ok
    assert [str(command) for command in checked.trees[0].commands] == [
        "Take [Nothing] to [pump] and do [Nothing] to [Nothing]"
    ]


@pytest.mark.parametrize("kind", ["table", "desk", "shelf"])
def test_furniture_stands_at_a_wall_and_the_robot_finds_an_object_on_it(own, kind):
    add(kind, own, "big one", "--in", "room 1")
    add("object", own, "coke", "--on", "big one")
    knowledge, world = load_knowledge(own / "knowledge.yaml"), load_world(own)
    top = knowledge.surfaces["big one"]
    assert (top.place, len(top.viewpoints)) == ("room 1", 1)
    assert knowledge.usual_surfaces("drink") == ("big one",)
    placed = [each for each in place_objects(world, 3) if each.surface == "big one"]
    assert len(placed) == 1
    for sentence in ("fetch me a coke", "go to the big one"):
        assert executive.check(sentence, world=str(own)).ok


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
    assert len(load_world(own).seed_rules.fronts) == 2


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
    (error,) = executive.check("go to room 2", world=str(own)).errors
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
    world = load_world(own)
    assert {name: each.folder for name, each in world.imports.items()} == {n: tmp_path / n for n in ("drill", "saw")}
    assert {each.name: each.surface for each in place_objects(world, 1)} == {"drill": "rack", "saw": "rack"}
    assert executive.check("fetch me the drill", world="own").ok
    hint = "there are beer, coke, extinguisher, hammer, screwdriver, wrench, person, cylinder, cube, saw and drill"
    assert hint in refusal("world", "add", "object", "own", "rocket", "--on", "rack")


def test_a_model_of_a_known_class_is_added_under_its_own_name(own, mesh, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    add("table", own, "rack")
    done("object", "import", mesh, "--name", "my_wrench", "--class", "wrench")
    add("object", "own", "my_wrench", "--on", "rack")
    assert [(each.name, each.class_name) for each in place_objects(load_world(own), 1)] == [("my_wrench", "wrench")]
    assert load_knowledge(own / "knowledge.yaml").usual_surfaces("wrench") == ("rack",)


def test_a_missing_folder_of_worlds_is_refused(tmp_path):
    refused = errand("world", "list", tmp_path / "extra")
    assert (refused.exit_code, "extra: there is no such folder" in refused.stderr) == (2, True)


def test_worlds_are_listed_with_rooms_and_robots(own, tmp_path):
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "world.dmd.yaml").write_text("directives: []\n")
    listed = done("world", "list", tmp_path)
    lines = {words[0]: " ".join(words[1:]) for words in map(str.split, listed.stdout.splitlines())}
    assert list(lines) == ["world", "flat", "lab", "shop", str(own)]
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


def test_options_of_a_building_are_refused_for_another_map(map_file, tmp_path):
    said = refusal("world", "from-map", map_file, "--out", tmp_path / "hall", "--level", "L1")
    assert "--level and --scale are for a building of Open-RMF" in said
