"""Each measure runs its smallest case to its end, and the case goes right."""

import json
import math
import os
import shlex
import subprocess
import sys

import pytest

from tests.benchmarks import robots_sentences, structured_sentences
from tests.benchmarks.errand_process import ROOT
from tests.benchmarks.speech.score import NO_VOICE

LIMIT_S = 600.0
NEEDED = {"spot_": "bosdyn.client", "speech.": "faster_whisper", "evaluation kill": "distributed"}
"""Packages without which some measures are skipped."""
MISSIONS = {
    "carry --classes coke --trials 1": lambda r: r["carried"] == 1,
    "closed_doors --first 9853 --count 1": lambda r: (r["named"], r["given_up_late"]) == (1, []),
    "everyday.run --only 12": lambda r: r["counts"] == {"success fulfilled": 1},
    "fetch --count 1 --things coke --goals Robin": lambda r: (r["fulfilled"], r["false_claims"]) == (1, 0),
    "fleet --what ticks": lambda r: 1.0 < r["ticks"]["ratio"] < 8.0,
    "hand_over --classes coke --trials 1": lambda r: (r["given"], r["false_claims"]) == (1, 0),
    "kill_and_resume --moments 1": lambda r: r["right"] == 1,
    "manipulation --classes coke --surfaces table --trials 1 --clutter 0": lambda r: r["placed_near_upright_rate"] == 1,
    "mission_speed --repeat 1": lambda r: r["mission"] > 0.0,
    "people_crossing --what crosses --count 1": lambda r: (
        (r["crosses"]["reached"], r["crosses"]["cases_with_contact_while_moving"]) == (1, 0)
    ),
    "people_missions --first 9764 --count 1": lambda r: r["right"] == 1,
    "people_tracking --count 1 --seconds 8": lambda r: r["visible"] > 20 and r["precision"] > 0.9,
    "people_trials --what guide --count 1": lambda r: r["guide"]["arrived"] == 1,
    "traffic --what door --count 1": lambda r: (r["door"]["resolved"], r["door"]["deadlocks"]) == (1, 0),
}
DRIVES = {
    "barn {barn}": lambda r: (r["runs"][0]["world"], r["success_rate"]) == (7, 1.0),
    "differential --goals 1 --worlds shop": lambda r: r[0]["reached"] == 1,
    "goals --goals 1": lambda r: (r["reached"], r["contacts"]) == (1, 0),
    "goals --goals 1 --doors": lambda r: (r["reached"], r["contacts"]) == (1, 0),
    "localisation kidnap --count 1": lambda r: (r["right_again"], r["wrong_claims"]) == (1, 0),
    "localisation record {out}/drive.npz --say 'go to the hall' && localisation replay {out}/drive.npz": lambda r: (
        r["localised"] == 1.0 and r["rms_cm"] < 5.0
    ),
    "localisation record {out}/drive.npz --say 'go to the hall' && localisation timing {out}/drive.npz": lambda r: (
        0.0 < r["filter_ms_median"] < r["localiser_ms_median"]
    ),
    "mapping --most 30 --out {out}": lambda r: r["walls_within"]["scan"]["5 cm"] > 0.9 and r["contacts"] == 0,
    "zone_drives --drives 1": lambda r: (r["reached"], r["entered_keep_out"], r["contacts"]) == (1, 0, 0),
}
VIEWS = {
    "find_things --flat 1 --rooms 0": lambda r: r["summary"]["flat"]["found"] == 1.0,
    "find_things --flat 0 --rooms 1": lambda r: r["summary"]["room"]["reported_absent"] == 1.0,
    "flat_pictures {out} --scenes 1": lambda r: r["labels_that_count"] > 0,
    "position_error --scenes 1 --seed 1 --folder {out}": lambda r: r["all"]["things"] > 0 and r["all"]["median_cm"] < 2,
    "tags --distance 1.2 --tilt 30 --views 20": lambda r: r["found"] == 1.0 and r["off_m_95"] < 0.02,
    "touching --scenes 2 --seed 4800": lambda r: r["all"]["objects"] > 4 and r["all"]["found"] > 0.5,
}
OTHERS = {
    "evaluation kill --runs 40": lambda r: (r["killed"], r["lost"], r["doubled"]) == (2, 0, 0),
    "evaluation report --results 20": lambda r: (r["results"], r["failures"]) == (20, 2),
    "speech.score --sentences 1 --chatter 1": lambda r: r["wake_missed_clear"] == 0.0,
    "grip --pads grid --things block --force-n 40": lambda r: r["held"] and r["failed"] == 0,
    "long_run --minutes 0.2 --every 0.1 --wait 1 --no-record": lambda r: (
        r["outcome"] == "success" and r["written_kb_per_min_last"] > 0
    ),
    "spot_fuzz --messages 200 --clients 20": lambda r: (
        (r["messages"], r["idle_clients"], r["inside"], r["logged"]) == (200, 20, [], [])
    ),
    "spot_kills --scripted --trials 2": lambda r: (
        (r["still"], r["free"], r["wrong"], r["with_policy"], r["off_by_policy"]) == (2, 2, [], 1, 1)
    ),
    "spot_latency --scripted --seconds 4": lambda r: (
        r["alone"]["state"]["count"] > 30
        and 0.9 < r["with_sensors"]["pace"] < 1.1
        and r["with_sensors"]["set_point"]["count"] > 10
    ),
    "spot_missions --missions 'go to the kitchen' --seed 3": lambda r: (r["same"], r["fulfilled"]) == (1, 1),
    "tick_time --more 0,1 --ticks 8 --rounds 1": lambda r: len(r["tick_us"]) == 2 and min(r["tick_us"].values()) > 0.0,
}
SMALLEST = {**MISSIONS, **DRIVES, **VIEWS, **OTHERS}


def output_of(words):
    """Output of a measure."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = {"cwd": ROOT, "env": environment, "capture_output": True, "text": True, "timeout": LIMIT_S}
    command = [sys.executable, "-m", *shlex.split(f"tests.benchmarks.{words}")]
    ended = subprocess.run(command, check=False, **process)
    if ended.returncode == NO_VOICE:
        pytest.skip(ended.stderr.strip())
    assert ended.returncode == 0, ended.stderr[-2000:]
    return ended.stdout


@pytest.fixture
def barn(tmp_path):
    """A narrow world in BARN's form: a free way of 4 m between two walls of cylinders."""
    cylinders = [(x, 0.15 * step, 0.075, 1.0) for x in (-1.2, 1.2) for step in range(40)]
    facts = {"world": 7, "start": [0.0, 1.0, math.pi / 2], "goal": [0.0, 5.0], "optimal_path_len": 4.0}
    (tmp_path / "barn").mkdir()
    (tmp_path / "barn" / "world_7.json").write_text(json.dumps({**facts, "cylinders": cylinders}))
    return tmp_path / "barn"


@pytest.mark.nightly
@pytest.mark.parametrize("words", SMALLEST)
def test_a_measure_runs_its_smallest_case(words, barn, tmp_path):
    for beginning, package in NEEDED.items():
        if words.startswith(beginning):
            pytest.importorskip(package)
    for command in words.format(barn=barn, out=tmp_path / "out").split(" && "):
        figures = json.loads(output_of(f"{command} --json").splitlines()[-1])
    assert SMALLEST[words](figures), figures


@pytest.mark.nightly
def test_a_run_is_equal_to_the_same_run_stored(tmp_path):
    output_of(f"equal_logs keep {tmp_path} --only ask")
    assert output_of(f"equal_logs compare {tmp_path} --only ask").startswith("ask: equal")


@pytest.mark.parametrize(
    ("measure", "table"),
    [
        *(pytest.param(structured_sentences, each, marks=pytest.mark.nightly) for each in structured_sentences.TABLES),
        *((robots_sentences, each) for each in robots_sentences.TABLES),
    ],
    ids=lambda each: getattr(each, "stem", ""),
)
def test_sentences_of_a_table_are_right_or_refused(measure, table):
    score = measure.measured(table)
    assert (score.right >= 0.97 * score.sentences, score.wrongly_accepted) == (True, ()), str(score)
