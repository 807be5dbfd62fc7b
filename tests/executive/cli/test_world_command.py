"""`errand world`, and `errand run` in what it makes."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

import executive
from executive.cli import entry
from executive.cli.options import join_values
from executive.words.knowledge import load_knowledge
from plant.worlds.seeding import place_objects
from plant.worlds.world import load_world

MAP = """image: room.pgm
resolution: 0.05
origin: [2.0, -1.0, {yaw}]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def invoke(*arguments: object):
    return CliRunner().invoke(entry.app, list(map(str, arguments)))


@pytest.fixture
def map_file(tmp_path: Path) -> Path:
    """A room of 6 x 5 m, turned."""
    room = np.full((104, 124), 0, np.uint8)
    room[2:-2, 2:-2] = 254
    cv2.imwrite(str(tmp_path / "room.pgm"), room)
    path = tmp_path / "room.yaml"
    path.write_text(MAP.format(yaw=0.3))
    return path


def test_a_goal_is_reached_in_a_world_made_of_a_map(map_file, tmp_path):
    made = invoke("world", "from-map", map_file, "--out", tmp_path / "hall")
    assert made.exit_code == 0, made.output
    assert ": 1 room, 0 doors, start at" in made.stdout
    shown = invoke("world", "show", tmp_path / "hall", "--out", tmp_path / "hall.png")
    assert shown.exit_code == 0, shown.output
    assert cv2.imread(str(tmp_path / "hall.png")).shape[1] == 1400
    goal = ("--set", "x=4.6", "--set", "y=1.6", "--set", "yaw=0.3", "--start", 3.6, 1.6, 0.3)
    out = ("--out", tmp_path / "out", "--no-record", "--quiet", "--json")
    ran = invoke("run", "go_to_pose", "--world", tmp_path / "hall", *goal, *out)
    assert ran.exit_code == 0, ran.output
    report = json.loads(ran.stdout.splitlines()[-1])
    assert report["referee"]["success"] and report["referee"]["collisions"] == 0
    assert report["sim_time_s"] < 8.0  # from the start that was given, a metre away


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("--start", 2.0, -1.0, 0.0), "room.yaml: the start (2, -1, 0) touches a wall"),
        (("--start", "here"), "--start here: a pose has 3 numbers, not 1"),
        (("--out", "{tmp}"), "it exists already"),
    ],
)
def test_bad_input_is_refused_in_one_line_with_status_2(map_file, tmp_path, arguments, why):
    given = [str(each).replace("{tmp}", str(tmp_path)) for each in arguments]
    result = invoke("world", "from-map", map_file, "--out", tmp_path / "hall", *given)
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert why in line
    assert not (tmp_path / "hall").exists()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('{"cylinders": [[1, 2', "c.json:1: damaged JSON"),
        ('{"pillars": []}', "cylinders: is missing"),
        ('{"cylinders": [[0, 0, -1, 1]]}', "cylinders.0.2: "),
        ('{"cylinders": []}', "cylinders: "),
        ('{"cylinders": [[0, 0, 1, 1], [9e3, 0, 1, 1]]}', "leave far ones out"),
    ],
)
def test_damaged_cylinders_are_refused(tmp_path, text, why):
    (tmp_path / "c.json").write_text(text)
    result = invoke("world", "from-cylinders", tmp_path / "c.json", "--out", tmp_path / "w")
    assert result.exit_code == 2
    assert "c.json" in result.stderr and why in result.stderr


def test_a_start_in_a_wall_of_the_flat_is_refused():
    result = invoke("run", "go_to_pose", "--start", 0.0, 0.0, 0.0)
    assert result.exit_code == 2
    assert "at the start (0, 0, 0) the robot stands in an obstacle" in result.stderr


@pytest.mark.parametrize(("setting", "why"), [("z=1", "has no parameter 'z'"), ("x", "is not NAME=VALUE")])
def test_a_value_that_the_file_does_not_take_is_refused(setting, why):
    result = invoke("run", "go_to_pose", "--set", setting)
    assert result.exit_code == 2
    assert why in result.stderr


def test_three_numbers_after_start_are_one_value():
    assert join_values(["run", "--start", "1", "-2", "0.5", "m.yaml"]) == ["run", "--start=1 -2 0.5", "m.yaml"]
    assert join_values(["run", "--start", "unknown", "m.yaml"]) == ["run", "--start", "unknown", "m.yaml"]


@pytest.mark.parametrize(
    ("words", "address"),
    [
        (["--foxglove"], "127.0.0.1:8765"),
        (["--foxglove", "--quiet"], "127.0.0.1:8765"),
        (["--foxglove", "patrol"], "127.0.0.1:8765"),
        (["--foxglove", "my/patrol.yaml"], "127.0.0.1:8765"),
        (["--foxglove", "0.0.0.0:9000", "patrol"], "0.0.0.0:9000"),
        (["--foxglove", "[::1]:9000"], "[::1]:9000"),
        (["--foxglove", "host:x"], "host:x"),
    ],
)
def test_foxglove_takes_an_address_or_the_usual_one(words, address):
    given = words[1:2] == [address]
    assert join_values(words) == [f"--foxglove={address}", *words[2 if given else 1 :]]


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """Folder of a world of two rooms with a door of 0.9 m, a dock and Robin."""
    rooms = np.full((120, 240), 0, np.uint8)
    rooms[4:-4, 4:118] = rooms[4:-4, 122:-4] = 254
    rooms[51:69, 118:122] = 254
    cv2.imwrite(str(tmp_path / "room.pgm"), rooms)
    (tmp_path / "room.yaml").write_text(MAP.format(yaw=0.0))
    made = invoke("world", "from-map", tmp_path / "room.yaml", "--out", tmp_path / "own")
    assert made.exit_code == 0, made.output
    return tmp_path / "own"


def add(*words: object) -> str:
    added = invoke("world", "add", *words)
    assert added.exit_code == 0, added.output
    return added.stdout


def test_a_world_of_a_map_has_a_person_and_a_dock_unless_they_are_not_wanted(own, tmp_path):
    facts = load_world(own)
    assert (facts.dock is not None, [person.name for person in facts.seed_rules.people]) == (True, ["Robin"])
    bare = ("world", "from-map", tmp_path / "room.yaml", "--out", tmp_path / "bare", "--no-dock", "--person", "")
    assert invoke(*bare).exit_code == 0
    assert (load_world(tmp_path / "bare").dock, (tmp_path / "bare" / "objects.yaml").exists()) == (None, False)


def test_a_room_gets_its_name_in_all_facts(own):
    add("room", own, "den", "--in", "room 1")
    knowledge = load_knowledge(own / "knowledge.yaml")
    assert "den" in knowledge.places and "room 1" not in (own / "knowledge.yaml").read_text()
    assert "den" in knowledge.doors[0].between
    refused = invoke("world", "add", "room", own, "den", "--in", "room 2")
    assert (refused.exit_code, "there is a 'den' already" in refused.stderr) == (2, True)


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


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("table", "{own}", "t", "--at", 2.0, -1.0, 0.0), "touches a wall or lies outside"),
        (("table", "{own}", "t", "--at", 7.5, 2.0, 3.1416), "the robot could no longer reach"),
        (("table", "{own}", "t", "--in", "attic"), "there is no room 'attic'"),
        (("table", "{own}", "t", "--size", 9, 1, 1), "0.3 to 3 m"),
        (("table", "{own}"), "a table needs a name"),
        (("object", "{own}", "coke", "--on", "shelf"), "there is no surface 'shelf'"),
        (("object", "{own}", "coke"), "lies on a surface"),
        (("dock", "{own}"), "there is a dock"),
        (("person", "{own}", "Robin"), "'Robin' is in knowledge.yaml already"),
        (("person", "{own}", "Maya", "--at", 1, 1, 0), "a person stands beside the robot's start"),
        (("room", "{own}", "den"), "the former name is missing"),
        (("table", "nowhere", "t"), "there is no such folder"),
    ],
)
def test_an_addition_that_does_not_fit_is_refused_and_changes_nothing(own, words, why):
    before = {file: file.read_bytes() for file in own.rglob("*") if file.is_file()}
    refused = invoke("world", "add", *(str(word).replace("{own}", str(own)) for word in words))
    assert (refused.exit_code, why in refused.stderr) == (2, True), refused.output
    assert {file: file.read_bytes() for file in own.rglob("*") if file.is_file()} == before


def test_an_unknown_class_is_refused_and_the_files_are_restored(own):
    add("table", own, "table")
    before = (own / "knowledge.yaml").read_text()
    refused = invoke("world", "add", "object", own, "unicorn", "--on", "table")
    assert (refused.exit_code, "unicorn" in refused.stderr) == (2, True), refused.output
    assert (own / "knowledge.yaml").read_text() == before


def zone(*words: object):
    return invoke("world", "zone", *words)


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


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("add", "{own}", "a", "--kind", "silent", "--in", "attic"), "there is no room 'attic'"),
        (("add", "{own}", "a", "--kind", "silent"), "'polygon'"),
        (("add", "{own}", "a", "--kind", "speed_limit", "--in", "room 1"), "'speed' or 'share'"),
        (("add", "{own}", "a", "--kind", "keep_out", "--polygon", "0 0, 1 0"), "polygon: should have 3"),
        (("add", "{own}", "a", "--kind", "keep_out", "--polygon", "here"), "--polygon here: no corners"),
        (("add", "{own}", "a", "--kind", "keep_out", "--mask", "/tmp/mask.yaml"), "leads out of the folder"),
        (("add", "{own}", "a", "--kind", "keep_out", "--mask", "{own}/mask.yaml"), "there is no file 'mask.yaml'"),
        (("add", "nowhere", "a", "--kind", "keep_out", "--in", "hall"), "there is no such folder"),
        (("remove", "{own}", "a"), "there is no zone 'a'"),
    ],
)
def test_a_zone_that_does_not_fit_is_refused_and_changes_nothing(own, words, why):
    before = (own / "knowledge.yaml").read_bytes()
    refused = zone(*(str(word).replace("{own}", str(own)) for word in words))
    assert (refused.exit_code, why in refused.stderr) == (2, True), refused.output
    assert (own / "knowledge.yaml").read_bytes() == before


def test_a_zone_in_one_line_with_others_is_not_removed(own):
    file = own / "knowledge.yaml"
    file.write_text(
        f"{file.read_text()}zones: {{a: {{kind: silent, place: room 1}}, b: {{kind: silent, place: room 2}}}}\n"
    )
    before = file.read_text()
    refused = zone("remove", own, "a")
    assert (refused.exit_code, "in a form that cannot be changed" in refused.stderr) == (2, True), refused.output
    assert file.read_text() == before
