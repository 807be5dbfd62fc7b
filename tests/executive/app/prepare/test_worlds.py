"""What a check says of a world of the user's own: its maps and its rooms."""

import shutil

import pytest

import executive
from executive.app.prepare.worlds import open_world, refuse_unusable, with_map
from skills.inputs.errors import InputError


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
