"""A data set's folder: goes on after a break, is the same then, and says what is wrong with it."""

import errno
import json
import shutil

import numpy as np
import pytest

from errand_train.dataset import shards
from errand_train.dataset.errors import DatasetError
from errand_train.dataset.render import Shot, is_validation, views_in
from errand_train.dataset.shards import render


def fake_scene(seed, index, others=()):
    """A scene without a renderer: noise from seed and number, one label for each picture."""
    rng = np.random.default_rng([seed, index])
    shots = []
    for number in range(views_in(index)):
        picture = rng.integers(0, 255, (24, 32, 3)).astype(np.uint8)
        facts = {"width": 32, "height": 24, "split": "val" if is_validation(index) else "train", "view": number}
        label = {"category_id": 1 + index % 9, "bbox": [1, 1, 9, 9], "ignore": 0, "instance": "hammer_001"}
        shots.append(Shot(picture, 90, facts, [label]))
    return shots


@pytest.fixture(autouse=True)
def no_renderer(monkeypatch):
    monkeypatch.setattr(shards, "render_scene", fake_scene)


def run(out, images=130, seed=4, progress=None, others=None):
    return render(out, images=images, seed=seed, progress=progress or (lambda done, total: None), others=others)


def content(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


class BreakOffError(RuntimeError):
    """Stands for a kill."""


def test_a_run_that_was_broken_off_goes_on_to_the_same_set(tmp_path):
    run(tmp_path / "whole")

    def stop(done, total):
        if done == 3:
            raise BreakOffError

    with pytest.raises(BreakOffError):
        run(tmp_path / "broken", progress=stop)
    made = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "broken" / "scenes").iterdir()}
    assert len(made) == 3
    half = tmp_path / "broken" / "scenes" / ".making-left"
    half.mkdir()
    (half / "0.jpg").write_bytes(b"half")
    run(tmp_path / "broken")
    assert content(tmp_path / "broken") == content(tmp_path / "whole")
    for name, stamp in made.items():
        assert (tmp_path / "broken" / "scenes" / name).stat().st_mtime_ns == stamp


def test_a_set_can_grow_and_keeps_its_first_pictures(tmp_path):
    run(tmp_path / "set", images=20)
    before = json.loads((tmp_path / "set" / "train.json").read_text())
    summary = run(tmp_path / "set", images=150)
    after = json.loads((tmp_path / "set" / "train.json").read_text())
    assert after["images"][:20] == before["images"]
    assert summary.images == {"train": 142, "val": 8}


def test_scenes_to_learn_from_are_seen_in_more_pictures_than_those_for_validation(tmp_path):
    run(tmp_path / "set", images=150)
    scenes = tmp_path / "set" / "scenes"
    assert [len(list((scenes / f"{k:06d}").glob("*.jpg"))) for k in (0, 4, 5, 6)] == [24, 24, 8, 24]


def test_only_the_wished_number_of_pictures_is_listed(tmp_path):
    summary = run(tmp_path / "set", images=50)
    assert sum(summary.images.values()) == 50
    assert sum(sum(found.values()) for found in summary.labels.values()) == 50
    assert (tmp_path / "set" / "contact_sheet.png").is_file()


def test_progress_begins_with_what_is_there_already(tmp_path):
    run(tmp_path / "set", images=48)
    told: list[tuple[int, int]] = []
    run(tmp_path / "set", images=96, progress=lambda done, total: told.append((done, total)))
    assert told == [(2, 4), (3, 4), (4, 4)]


def test_a_folder_of_another_seed_is_refused(tmp_path):
    run(tmp_path / "set", images=8, seed=4)
    with pytest.raises(DatasetError, match=r"has seed 4, not 5; give --seed 4"):
        run(tmp_path / "set", images=8, seed=5)


def test_a_folder_of_another_version_is_refused(tmp_path):
    run(tmp_path / "set", images=8)
    path = tmp_path / "set" / "dataset.json"
    path.write_text(path.read_text().replace(shards.digest(), "0123456789"))
    with pytest.raises(DatasetError, match="another version"):
        run(tmp_path / "set", images=8)


def others_in(folder, *names):
    for name in names:
        facts = {"category": "other", "seed": 0, "class_id": 0, "kind": name, "colour": "", "mass_kg": 0.5}
        (folder / name).mkdir(parents=True)
        (folder / name / "model.json").write_text(json.dumps({**facts, "com_m": [0, 0, 0], "size_m": [0.1, 0.1, 0.1]}))
    return folder


def test_models_of_others_lie_about_in_every_scene(tmp_path, monkeypatch):
    given: list[list[str]] = []

    def noted(seed, index, others=()):
        given.append([model.kind for model in others])
        return fake_scene(seed, index)

    monkeypatch.setattr(shards, "render_scene", noted)
    run(tmp_path / "set", images=30, others=others_in(tmp_path / "others", "kettle", "radio"))
    assert given == [["kettle", "radio"]] * 2


def test_a_set_with_other_models_of_others_is_refused(tmp_path):
    run(tmp_path / "set", images=8, others=others_in(tmp_path / "first", "kettle"))
    with pytest.raises(DatasetError, match="another version"):
        run(tmp_path / "set", images=8, others=others_in(tmp_path / "second", "radio"))
    with pytest.raises(DatasetError, match="another version"):
        run(tmp_path / "set", images=8)


def test_a_folder_without_models_of_others_is_named(tmp_path):
    with pytest.raises(DatasetError, match=r"empty: holds no folder with model\.json"):
        run(tmp_path / "set", others=tmp_path / "empty")
    assert not (tmp_path / "set").exists()


# model.json of the kettle                 named as
# is cut off                               damaged
# lacks a key                              damaged
# says that it is a hammer, of class 4     of a class
@pytest.mark.parametrize(
    ("facts", "named"),
    [("{", "model.json: is damaged"), ('{"category": "other"}', "model.json: is damaged"), (None, "is a hammer")],
)
def test_a_model_that_cannot_be_a_distractor_is_named(tmp_path, facts, named):
    file = others_in(tmp_path / "others", "kettle", "radio") / "kettle" / "model.json"
    of_a_class = {**json.loads(file.read_text()), "category": "hammer", "class_id": 4}
    file.write_text(json.dumps(of_a_class) if facts is None else facts)
    with pytest.raises(DatasetError, match=f"kettle.*{named}"):
        run(tmp_path / "set", others=tmp_path / "others")
    assert not (tmp_path / "set").exists()


@pytest.mark.parametrize("text", ["{", "[]", ""])
def test_a_damaged_manifest_is_named(tmp_path, text):
    run(tmp_path / "set", images=8)
    (tmp_path / "set" / "dataset.json").write_text(text)
    with pytest.raises(DatasetError, match=r"dataset\.json: is damaged"):
        run(tmp_path / "set", images=8)


def test_a_folder_with_other_files_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(DatasetError, match=r"holds other files and no dataset\.json"):
        run(tmp_path, images=8)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_damaged_scene_is_named_with_the_mend(tmp_path):
    run(tmp_path / "set", images=48)
    (tmp_path / "set" / "scenes" / "000001" / "shots.json").write_text("{")
    with pytest.raises(DatasetError, match=r"000001.*damaged.*remove .*000001"):
        run(tmp_path / "set", images=48)
    shutil.rmtree(tmp_path / "set" / "scenes" / "000001")
    assert sum(run(tmp_path / "set", images=48).images.values()) == 48


def test_a_file_in_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "set").write_text("a file")
    with pytest.raises(DatasetError, match="cannot be written"):
        run(tmp_path / "set", images=8)


def test_a_full_disk_is_reported_and_leaves_only_whole_scenes(tmp_path, monkeypatch):
    run(tmp_path / "set", images=24)

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(shards, "_write_files", full)
    with pytest.raises(DatasetError, match="the disk is full; make room; the same command goes on"):
        run(tmp_path / "set", images=48)
    assert [path.name for path in (tmp_path / "set" / "scenes").iterdir()] == ["000000"]


def test_a_lost_scene_is_reported_and_the_others_stay(tmp_path):
    def lose_the_second(function, numbers):
        return ((number, None if number == 1 else function(number)) for number in numbers)

    with pytest.raises(DatasetError, match=r"rendered scene 1 were killed; .*goes on where it stopped"):
        render(tmp_path / "set", images=72, seed=4, progress=lambda done, total: None, give_out=lose_the_second)
    assert [path.name for path in (tmp_path / "set" / "scenes").iterdir()] == ["000000"]
