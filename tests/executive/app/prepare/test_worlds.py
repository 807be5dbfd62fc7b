"""What a check says of a world of the user's own: its maps and its rooms."""

import shutil
from dataclasses import replace

import pytest

import executive
from executive.app.prepare.worlds import open_world, refuse_unusable, with_map
from skills.inputs.errors import InputError
from skills.robot import Pose2D


@pytest.fixture
def own(tmp_path):
    shutil.copytree(open_world("flat").folder, tmp_path / "own", ignore=shutil.ignore_patterns("truth"))
    return tmp_path / "own"


def written(key, value):
    def write(folder):
        file = folder / "scan.yaml"
        lines = [line for line in file.read_text().splitlines() if not line.startswith(f"{key}:")]
        file.write_text("\n".join([*lines, f"{key}: {value}"]))

    return write


#   what is wrong with the scan map                                             a part of the refusal
BROKEN = [
    (written("resolution", "0.0"), "resolution: should be from"),
    (written("resolution", ".nan"), "resolution: should be a finite number"),
    (written("origin", "[.inf, 0.0, 0.0]"), "should be a finite number"),
    (lambda folder: (folder / "scan.pgm").write_bytes(b""), "scan.pgm: it is empty"),
    (lambda folder: (folder / "scan.pgm").write_bytes(b"P5\n9 9\n255\n"), "its head says 9 x 9 pixels"),
    (written("image", "../../scan.pgm"), "leads out of the folder map"),
    (lambda folder: (folder / "scan.yaml").unlink(), "there is no such file"),
    (lambda folder: (folder / "low_scan.pgm").unlink(), "there is no such file"),
]


@pytest.mark.parametrize(("breaks", "message"), BROKEN, ids=[message[:24] for _, message in BROKEN])
def test_a_check_refuses_a_scan_map_that_cannot_be_read(own, breaks, message):
    breaks(own / "map")
    (error,) = executive.check("go to the kitchen", world=str(own)).errors
    assert message in str(error) and "scan" in str(error)


def test_a_map_of_another_folder_is_read_as_well(own):
    world = with_map(open_world("flat"), own / "map")
    written("resolution", "0")(own / "map")
    with pytest.raises(InputError, match="resolution: should be from"):
        refuse_unusable(world)


def test_a_room_whose_outline_crosses_itself_is_a_warning(own):
    assert executive.check("go to the kitchen", world=str(own)).warnings == ()
    file = own / "knowledge.yaml"
    file.write_text(file.read_text().replace("places:\n", f"places:\n{CROSSING}", 1))
    checked = executive.check("go to the kitchen", world=str(own))
    (warning,) = checked.warnings
    assert checked.ok and "places.knot.polygon: the outline crosses itself" in str(warning) and warning.line


CROSSING = "  knot: {pose: {x: 1.0, y: 1.0, yaw: 0.0}, polygon: [[0, 0], [2, 2], [2, 0], [0, 2]]}\n"

NAMED = "{pose: {x: 9.2, y: 4.6, yaw: 0.0}}"


def with_places(own, *names):
    """The world with further named poses."""
    file = own / "knowledge.yaml"
    places = "".join(f'  "{name}": {NAMED}\n' for name in names)
    file.write_text(file.read_text().replace("places:\n", f"places:\n{places}", 1))
    return str(own)


def test_names_that_no_sentence_can_say_are_warned_of(own):
    checked = executive.check("go to the kitchen", world=with_places(own, "#", "please", "x"))
    said = [str(warning) for warning in checked.warnings]
    assert checked.ok and len(said) == 3 and all(warning.line for warning in checked.warnings)
    assert "places.#: no sentence can say this name; write a name of words" in said[0]


def test_names_that_a_sentence_says_in_another_form_are_not_warned_of(own):
    world = with_places(own, "A", "lab #2", "room 2", "caf\u00e9", "pantry/left", "store_room", "\u6570")
    assert executive.check("go to the kitchen", world=world).warnings == ()


STANDS = "people:\n  - {{name: {}, pose: {{x: {}, y: {}}}}}\n"
"""Begins the people of a world's rules; the flat's own Robin stands about (10.4, 3.9)."""


#   who stands where                     what the check says, None: nothing
@pytest.mark.parametrize(
    ("name", "x", "y", "says"),
    [
        ("Kim", 4.0, 4.4, None),
        ("Kim", 10.4, 3.95, "Robin would stand in Kim at"),
        ("Kim", 7.9, 8.5, "Kim would stand in kitchen_counter at (7.90, 8.50)"),
        ("Kim", 0.1, 4.4, "Kim would stand in shell at (0.10, 4.40)"),
    ],
)
def test_a_check_refuses_people_who_stand_in_something(own, name, x, y, says):
    file = own / "objects.yaml"
    file.write_text(file.read_text().replace("people:", STANDS.format(name, x, y).rstrip() + "  #", 1))
    errors = executive.check("go to the kitchen", world=str(own)).errors
    assert (not errors) if says is None else (says in str(errors[0]) and errors[0].file == file and errors[0].line)


def test_people_who_move_with_a_start_that_the_user_gives_are_not_tried(own):
    world = open_world(str(own))
    refuse_unusable(replace(world, start=Pose2D(8.0, 7.6, 1.57)))


def test_a_check_refuses_a_person_of_a_mission_who_begins_in_something(tmp_path):
    file = tmp_path / "m.yaml"
    file.write_text("name: m\nsteps: [{to: kitchen}]\npeople: {Kim: {waypoints: [[1.2, 8.4]]}}\n")
    (error,) = executive.check(file).errors
    assert error.message == "Kim would stand in workbench at (1.20, 8.40)"
