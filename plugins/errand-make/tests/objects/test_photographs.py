"""Photographs become a model without a mesh; those that cannot be used are refused by name."""

import cv2
import numpy as np
import pytest
from table_robot import TableRobot, context_of, outcome
from table_scene import GREEN, TABLE, Can

from errand_make.objects import ImportOptions, ImportReports, import_photographs
from errand_make.objects.photographs import cut_out
from executive.app.report.artifacts import Artifacts, save_views
from executive.tree.registry import installed_skills
from plant.models.catalogue import read_imported
from skills.inputs.errors import InputError
from skills.perception.object_model import read_model
from tests.tables import table

RED, GROUND = (190, 40, 35), (120, 150, 160)
SIZE_M = (0.08, 0.06, 0.1)


def photograph(file, box=(140, 100, 260, 250), ground=GROUND, colour=RED, *, opaque=True):
    """A box of one colour before a plain ground that is lighter at the right, with noise."""
    rng = np.random.default_rng(3)
    picture = np.tile(np.array(ground, float), (320, 400, 1)) + np.linspace(-12, 12, 400)[None, :, None]
    u0, v0, u1, v1 = box
    picture[v0:v1, u0:u1] = colour
    picture = np.clip(picture + rng.normal(0, 2, picture.shape), 0, 255).astype(np.uint8)
    if not opaque:
        alpha = np.zeros((320, 400, 1), np.uint8)
        alpha[v0:v1, u0:u1] = 255
        picture = np.dstack([picture, alpha])
    cv2.imwrite(str(file), cv2.cvtColor(picture, cv2.COLOR_RGB2BGR if opaque else cv2.COLOR_RGBA2BGRA))
    return file


def series(folder, count=4):
    folder.mkdir()
    for k in range(count):
        photograph(folder / f"{k}.png", opaque=bool(k % 2))
    return folder


@pytest.mark.parametrize(("name", "opaque"), [("a.jpg", True), ("a.png", True), ("clear.png", False)])
def test_an_object_is_cut_out_of_its_background(tmp_path, name, opaque):
    cut = cut_out(photograph(tmp_path / name, opaque=opaque))
    assert cut.shape[:2] == pytest.approx((150, 120), abs=3)
    assert np.abs(np.median(cut[cut[..., 3] > 127][:, :3], axis=0) - RED).max() < 6


@pytest.mark.parametrize(*table(__file__, "no_whole_object"))
def test_a_photograph_that_shows_no_whole_object_is_refused_by_name(tmp_path, box, colour, why):
    with pytest.raises(InputError, match=f"photo.png: {why}"):
        cut_out(photograph(tmp_path / "photo.png", box, colour=colour))


def test_a_background_that_is_not_plain_is_refused(tmp_path):
    file = photograph(tmp_path / "photo.png")
    picture = cv2.imread(str(file))
    picture[:, (np.arange(400) // 20) % 2 == 0] = (20, 160, 20)
    cv2.imwrite(str(file), picture)
    with pytest.raises(InputError, match=r"photo.png: the background is not plain; photograph the object before"):
        cut_out(file)


def test_photographs_make_a_model_of_the_given_size_and_their_views(tmp_path):
    out = tmp_path / "mug"
    out.mkdir()
    photographs = series(tmp_path / "photographs", 5)
    (photographs / "4.png").write_bytes(b"no picture")
    notes = list[str]()
    made = import_photographs(photographs, ImportOptions("mug", 0.3), out, ImportReports(note=notes.append), SIZE_M)
    bad = photographs / "4.png"
    assert notes == [f"left out: {bad}: it is no picture; name a file in PNG, JPEG, WebP, TIFF or BMP"]
    assert (made.photographs, made.size_m, made.class_name, made.mass_kg) == (4, SIZE_M, "mug", 0.3)
    assert read_imported(out) == made
    model = read_model(out)
    assert (np.ptp(model.points, axis=0), model.views.shape) == (pytest.approx(SIZE_M, abs=2e-3), (4, 24, 24, 4))
    assert (model.views[..., 3] > 127).sum(axis=(1, 2)) == pytest.approx([24 * 19] * 4, abs=25)


@pytest.mark.parametrize("count", [0, 1, 3, 61])
def test_too_few_or_too_many_photographs_are_refused(tmp_path, count):
    photographs = series(tmp_path / "photographs", count)
    with pytest.raises(InputError, match=f"it has {count} photographs?; give 4 to 60 photographs"):
        import_photographs(photographs, ImportOptions("mug"), tmp_path, ImportReports(), SIZE_M)


def test_photographs_of_a_phone_are_refused_by_their_names(tmp_path):
    for k in range(4):
        (tmp_path / f"{k}.HEIC").write_bytes(b"\0\0\0\x1cftypheic" + bytes(64))
    with pytest.raises(InputError, match=r"of 4 photographs 0 can be used") as caught:
        import_photographs(tmp_path, ImportOptions("mug"), tmp_path, ImportReports(), SIZE_M)
    assert "save it as JPEG: heif-convert 0.HEIC 0.jpg" in str(caught.value.others[0])


def test_less_than_four_good_photographs_are_refused_with_the_bad_ones(tmp_path):
    photographs = series(tmp_path / "photographs", 5)
    for name in ("1.png", "2.png"):
        photograph(photographs / name, (140, 100, 260, 320))
    with pytest.raises(InputError, match=r"of 5 photographs 3 can be used") as caught:
        import_photographs(photographs, ImportOptions("mug"), tmp_path, ImportReports(), SIZE_M)
    assert [each.file.name for each in caught.value.others if each.file] == ["1.png", "2.png"]


def test_the_views_of_an_unexplained_object_are_photographs_of_it(tmp_path):
    log, artifacts, out, notes = [], Artifacts(), tmp_path / "tin", list[str]()
    robot = TableRobot(things=[Can(1.1, 0.2, 0.06, 0.2, GREEN)])
    detect = installed_skills()["detect"]
    outcome(detect(context_of(robot, log)), detect.Inputs(("extinguisher",), (TABLE,)))
    for topic, message in log:
        artifacts.message(topic, message)
    save_views(artifacts, tmp_path)
    out.mkdir()
    reports = ImportReports(note=notes.append)
    made = import_photographs(tmp_path / "what_is_this_1", ImportOptions("tin"), out, reports, (0.12, 0.12, 0.2))
    assert notes == []
    assert made.photographs >= 4
    views = read_model(out).views
    assert np.abs(np.median(views[views[..., 3] > 127][:, :3], axis=0) - GREEN).max() < 6
