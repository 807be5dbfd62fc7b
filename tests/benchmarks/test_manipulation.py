"""Figures of the manipulation benchmark: spots, failures, sheets, shapes, ways through doors."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from plant.models.catalogue import ImportedObject, read_imported
from plant.worlds.seeding import place_objects, place_people
from tests.benchmarks.carry import doors, entered
from tests.benchmarks.manipulation import (
    TimedWorker,
    cases,
    ends_pick,
    failure,
    failures,
    is_false_claim,
    near_upright,
    place_error_m,
    write_sheet,
)
from tests.benchmarks.manipulation_room import PERSON, room
from tests.benchmarks.shapes import DENSITY_KG_M3, SLENDER, random_shape, written_shape

RIGHT = dict.fromkeys(("lifted", "held_10s", "placed", "placed_upright"), True) | {"place_error_m": 0.02, "cause": ""}


def trial(**other):
    return SimpleNamespace(**{"name": "coke", "surface": "floor", "seed": 7, "ending": None, **RIGHT, **other})


GOOD, FAR, FALLEN = trial(), trial(place_error_m=0.06), trial(placed_upright=False)
UNSEEN = {"cause": "PLANNING: no path", "placed": False, "placed_upright": None, "place_error_m": None}


class DoneAtOnce:
    """A worker that works when it is asked to, and gives the result as the job."""

    def submit(self, work, *, latency_s, name):
        return work()

    def sense(self, read, work, *, latency_s, name):
        return work(read())


def test_a_place_error_is_measured_along_the_surface_from_a_spot():
    assert place_error_m((1.0, 2.0), np.array([1.03, 2.04, 0.8])) == pytest.approx(0.05)
    assert place_error_m(None, np.zeros(3)) is None


@pytest.mark.parametrize(
    ("trial", "near", "why"),
    [
        (GOOD, True, ""),
        (FAR, False, ""),
        (FALLEN, False, "fell over on the second table"),
        (trial(**UNSEEN), False, "PLANNING: no path"),
    ],
)
def test_a_trial_is_near_upright_within_5_cm_or_tells_why_it_failed(trial, near, why):
    assert (near_upright(trial), failure(trial)) == (near, why)


# claimed, lifted, held (s) -> a false claim
@pytest.mark.parametrize(
    ("claimed", "lifted", "held_s", "false"),
    [
        (True, True, 12.0, False),
        (True, False, 0.0, True),
        (False, True, 12.0, True),
        (False, True, 0.4, False),  # fell as it was lifted
        (False, False, 0.0, False),
    ],
)
def test_a_false_claim_is_of_what_was_never_lifted_or_none_of_what_was_held(claimed, lifted, held_s, false):
    assert is_false_claim(claimed, lifted=lifted, held_s=held_s) is false


@pytest.mark.parametrize(
    ("node", "ends"),
    [
        ("alice/trial/1-table/grasp", True),
        ("alice/trial/1-table/in-hand/only-if", True),
        ("alice/trial/1-table/in-hand/tuck", False),
        ("alice/trial/1-table/approach", False),
    ],
)
def test_a_grasp_or_a_tool_found_in_the_hand_ends_a_pick(node, ends):
    assert ends_pick(node) is ends


def test_failures_are_counted_by_class_and_cause():
    lines = [line.split() for line in failures([GOOD, trial(**UNSEEN), FALLEN, trial(**UNSEEN)])]
    assert [line[:2] for line in lines] == [["2", "coke"], ["1", "coke"]]


def test_a_sheet_has_a_picture_for_each_failure(tmp_path):
    ending, path = tmp_path / "ending.png", tmp_path / "made" / "sheet.png"
    cv2.imwrite(str(ending), np.zeros((60, 80, 3), np.uint8))
    assert "2 failed trials" in write_sheet(path, [GOOD, *[trial(**UNSEEN, ending=ending)] * 2])
    assert cv2.imread(str(path)).shape[1] == 2 * 400


def test_without_failures_no_sheet_is_written(tmp_path):
    assert "no trial failed" in write_sheet(tmp_path / "sheet.png", [GOOD])
    assert not (tmp_path / "sheet.png").exists()


def test_work_is_timed_by_name_also_when_it_fails():
    worker = TimedWorker(DoneAtOnce())
    assert worker.submit(lambda: 3, latency_s=0.1, name="plan") == 3
    assert worker.sense(lambda: 3, lambda given: given + 1, latency_s=0.1, name="look") == 4
    with pytest.raises(ZeroDivisionError):
        worker.submit(lambda: 1 // 0, latency_s=0.1, name="plan")
    assert {name: len(spent_s) for name, spent_s in worker.spent_s.items()} == {"plan": 2, "look": 1}


def test_the_shape_of_a_seed_stays_within_what_the_gripper_takes():
    for seed in range(200):
        shape = random_shape(seed)
        x, y, z = shape.size_m
        assert 0.02 <= y <= 0.10
        assert 0.02 <= min(x, z) <= max(x, z) <= 0.30
        assert shape.kind == "block" or z <= SLENDER * min(x, y)
        assert DENSITY_KG_M3[0] <= shape.density_kg_m3 <= DENSITY_KG_M3[1]
        assert random_shape(seed) == shape != random_shape(seed + 1)


def test_a_shape_is_written_as_an_imported_object_of_its_size(tmp_path):
    pytest.importorskip("coacd")
    made = read_imported(written_shape(502, tmp_path))
    assert made.name == made.class_name == "cylinder_502"
    assert sorted(made.size_m) == pytest.approx(sorted(random_shape(502).size_m), rel=0.02)


def test_a_room_is_entered_once_and_a_doorway_is_none():
    rooms = []
    for name in ("kitchen", "kitchen", None, "hall", "hall", "bedroom", None, "hall"):
        rooms = entered(rooms, name)
    assert rooms == ["kitchen", "hall", "bedroom", "hall"]
    assert doors(rooms) == 3


def test_the_opening_between_hall_and_living_room_is_no_door():
    assert doors(["hall", "living room", "kitchen"]) == 1


def test_a_crowded_room_leaves_out_the_objects_that_do_not_fit(tmp_path):
    world = room(tmp_path, "hammer", ["extinguisher"] * 8, "shelf", 22)
    names = [placed.name for placed in place_objects(world, 22)]
    assert names[0] == "target"
    assert len(names) < 9


def test_a_person_stands_in_a_room_for_handing_over(tmp_path):
    (person,) = place_people(room(tmp_path, "coke", (), "table", 3, person=True), 3)
    assert (person.name, person.receiving is not None) == (PERSON, True)


def test_objects_of_your_own_are_asked_for_by_class_or_as_anything_with_nothing_around(tmp_path):
    for name, class_name in (("mug", "mug"), ("old_hammer", "hammer")):
        (tmp_path / name).mkdir()
        (tmp_path / name / f"{name}.sdf").touch()
        ImportedObject(
            name=name,
            class_name=class_name,
            mass_kg=0.5,
            size_m=(0.2, 0.1, 0.03),
            com_m=(0.0, 0.0, 0.0),
            inertia_kg_m2=(0.01, 0.01, 0.01, 0.0, 0.0, 0.0),
            collision_parts=1,
            triangles=12,
            round=False,
        ).write(tmp_path / name)
    drawn = [case[:3] for case in cases(models=tmp_path, clutter="2", trials=1)]
    assert drawn == [("thing", "table", 0), ("hammer", "table", 2)]
