"""Each measure runs its smallest case to its end: what nobody runs for a while breaks unseen."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.benchmarks import robots_sentences, structured_sentences

ROOT = Path(__file__).parents[2]
NO_VOICE = 3
LIMIT_S = 600.0


def output_of(*command):
    """What a measure prints."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = {"cwd": ROOT, "env": environment, "capture_output": True, "text": True, "timeout": LIMIT_S}
    ended = subprocess.run([sys.executable, *command], check=False, **process)
    if ended.returncode == NO_VOICE:
        pytest.skip(ended.stderr.strip())
    assert ended.returncode == 0, ended.stderr[-2000:]
    return ended.stdout


def result_of(name, *arguments):
    """The JSON that a measure prints at its end."""
    text = output_of("-m", f"tests.benchmarks.{name}", *map(str, arguments))
    return json.loads(text[min(text.find(mark) for mark in "{[" if mark in text) :])


@pytest.fixture
def barn_folder(tmp_path):
    """A narrow world in BARN's form: two walls of cylinders with a free way of 4 m between start and goal."""
    cylinders = [(x, 0.15 * step, 0.075, 1.0) for x in (-1.2, 1.2) for step in range(40)]
    facts = {"world": 7, "start": [0.0, 1.0, math.pi / 2], "goal": [0.0, 5.0], "optimal_path_len": 4.0}
    (tmp_path / "world_7.json").write_text(json.dumps({**facts, "cylinders": cylinders}))
    return tmp_path


@pytest.mark.nightly
def test_ticks_of_a_small_and_a_larger_tree_are_timed():
    result = result_of("tick_time", "--more", 0, 1, "--ticks", 8, "--rounds", 1)
    assert len(result["tick_us"]) == 2 and min(result["tick_us"].values()) > 0.0, result


@pytest.mark.nightly
def test_a_run_is_equal_to_the_same_run_kept(tmp_path):
    run = ("-m", "tests.benchmarks.equal_logs")
    output_of(*run, "keep", str(tmp_path), "--only", "ask")
    assert output_of(*run, "compare", str(tmp_path), "--only", "ask").startswith("ask: equal")


@pytest.mark.nightly
def test_a_narrow_world_without_map_is_driven_through(barn_folder):
    result = result_of("barn", barn_folder, "--jobs", 1)
    assert (result["runs"][0]["world"], result["success_rate"]) == (7, 1.0), result


@pytest.mark.nightly
@pytest.mark.parametrize("doors", [(), ("--doors",)], ids=["flat", "door"])
def test_a_goal_is_driven_to(doors):
    result = result_of("goals", "--goals", 1, *doors)
    assert (result["goals"], result["reached"], result["contacts"]) == (1, 1, 0), result


@pytest.mark.nightly
def test_a_base_that_cannot_go_sideways_drives_to_a_goal():
    assert result_of("differential", "--goals", 1, "--worlds", "shop")


@pytest.mark.nightly
def test_an_object_is_carried():
    result = result_of("carry", "--classes", "coke", "--trials", 1, "--jobs", 1, "--json")
    assert len(result["runs"]) == 1


@pytest.mark.nightly
def test_an_object_is_handed_over():
    result = result_of("hand_over", "--classes", "coke", "--trials", 1, "--jobs", 1, "--json")
    assert (result["given"], result["false_claims"]) == (1, 0), result


@pytest.mark.nightly
def test_an_object_is_taken_held_and_put_down():
    options = ("--classes", "coke", "--surfaces", "table", "--trials", 1, "--clutter", "0-0", "--jobs", 1, "--json")
    assert len(result_of("manipulation", *options)["runs"]) == 1


@pytest.mark.nightly
def test_fetch_brings_something(tmp_path):
    result = result_of("fetch", "--count", 1, "--things", "coke", "--goals", "Robin", "--out", tmp_path)
    assert result["missions"] == 1


@pytest.mark.nightly
def test_objects_are_looked_for_in_the_flat_and_in_rooms():
    assert result_of("find_things", "--flat", 1, "--rooms", 1)


@pytest.mark.nightly
def test_pictures_of_the_flat_are_labelled(tmp_path):
    output_of("-m", "tests.benchmarks.flat_pictures", str(tmp_path), "--scenes", "1")
    assert json.loads((tmp_path / "val.json").read_text())["images"]


@pytest.mark.nightly
def test_positions_are_compared_with_the_truth(tmp_path):
    output_of("-m", "tests.benchmarks.position_scenes", "--scenes", "1", "--out", str(tmp_path))
    assert result_of("position_error", "--folder", tmp_path)


@pytest.mark.nightly
def test_a_fleet_is_ticked(tmp_path):
    assert result_of("fleet", "--what", "ticks", "--out", tmp_path)


@pytest.mark.nightly
def test_a_killed_mission_is_taken_up(tmp_path):
    output_of("-m", "tests.benchmarks.kill_and_resume", "--moments", "1", "--out", str(tmp_path))


@pytest.mark.nightly
def test_a_carried_off_robot_finds_its_place():
    assert result_of("localisation", "kidnap", "--count", 1)


@pytest.mark.nightly
def test_a_drive_is_recorded_followed_and_timed(tmp_path):
    drive = tmp_path / "drive.npz"
    output_of("-m", "tests.benchmarks.localisation", "record", str(drive), "--say", "Hey Alice, go to the hall")
    assert result_of("localisation", "replay", drive)
    assert result_of("localisation", "timing", drive)


@pytest.mark.nightly
def test_a_map_is_made(tmp_path):
    assert result_of("mapping", "--most", 30, "--out", tmp_path)


@pytest.mark.nightly
def test_the_speed_of_a_mission_is_measured():
    assert "median: mission" in output_of("-m", "tests.benchmarks.mission_speed", "--repeat", "1")


@pytest.mark.nightly
def test_a_person_at_a_random_place_is_met():
    assert result_of("people_missions", "--only", 9764, "--json")["missions"] == 1


@pytest.mark.nightly
def test_people_are_tracked_in_scans():
    result = result_of("people_tracking", "--count", 1, "--seconds", 8)
    assert result["visible"] > 20 and result["precision"] > 0.9, result


@pytest.mark.nightly
def test_somebody_crosses_the_way():
    assert result_of("people_crossing", "--what", "crosses", "--count", 1, "--json")


@pytest.mark.nightly
def test_a_person_is_guided():
    assert result_of("people_trials", "--what", "guide", "--count", 1)["guide"]["runs"] == 1


@pytest.mark.nightly
def test_a_drive_among_zones_is_judged():
    assert result_of("zone_drives", "--drives", 1)["entered_keep_out"] == 0


@pytest.mark.nightly
def test_two_robots_meet_at_a_door(tmp_path):
    assert result_of("traffic", "--what", "door", "--count", 1, "--out", tmp_path)


@pytest.mark.nightly
def test_an_everyday_sentence_is_run(tmp_path):
    text = output_of("tests/benchmarks/everyday/run.py", "--only", "12", "--jobs", "1", "--out", str(tmp_path))
    assert "| come here | success | fulfilled |" in text


@pytest.mark.nightly
def test_a_spoken_sentence_is_scored():
    pytest.importorskip("faster_whisper")
    text = output_of("tests/benchmarks/speech/score.py", "--sentences", "1", "--chatter", "1", "--json")
    assert json.loads(text.splitlines()[-1])


@pytest.mark.nightly
def test_a_killed_dask_worker_loses_no_run():
    pytest.importorskip("distributed")
    output_of("-m", "tests.benchmarks.evaluation", "kill", "--runs", "40")


@pytest.mark.nightly
def test_many_results_are_reported():
    assert "20 results" in output_of("-m", "tests.benchmarks.evaluation", "report", "--results", "20")


@pytest.mark.parametrize("measure", [pytest.param(structured_sentences, marks=pytest.mark.nightly), robots_sentences])
def test_a_table_of_sentences_is_scored(measure):
    score = measure.measured(measure.TABLES[-1])
    assert (score.right > 0.9 * score.sentences, score.wrongly_accepted) == (True, ()), str(score)


@pytest.mark.nightly
def test_objects_close_together_are_told_apart():
    result = result_of("touching", "--scenes", 2, "--seed", 4800)
    assert result["all"]["objects"] > 4 and result["all"]["found"] > 0.5, result


@pytest.mark.nightly
def test_a_room_behind_closed_doors_is_given_up(tmp_path):
    result = result_of("closed_doors", "--first", 9853, "--count", 1, "--out", tmp_path)
    assert (result["named"], result["given_up_late"]) == (1, []), result
