"""Two public robots, described after their published dimensions: what is read, and what they do in the flat."""

import json
import os
import subprocess
import sys

import numpy as np
import public_robots
import pytest

from errand_make.robots.package import render_robot
from plant.robots.urdf_robot.kind import urdf_kind
from skills.inputs.yaml_source import read_yaml

KINDS = {"published_fetch": public_robots.fetch, "published_waffle": public_robots.waffle}


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """Folder with a package of each robot, and the notes on them."""
    folder = tmp_path_factory.mktemp("public")
    notes = dict[str, str]()
    for name, urdf in KINDS.items():
        (folder / f"{name}.urdf").write_text(urdf())
        notes[name] = "\n".join(render_robot(name, folder / f"{name}.urdf", folder / name, packages={}))
    return folder, notes


@pytest.fixture(scope="module")
def installed(packages, tmp_path_factory):
    """Environment of a process in which both robots are installed."""
    site = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "pip", "install", "-q", "--no-build-isolation", "--no-deps", "--target", str(site)]
    subprocess.run([*command, *(str(packages[0] / name) for name in KINDS)], check=True)
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(site), *sys.path])}


def report_of(environment, out, kind, say):
    """Report of a run by a robot of a kind."""
    command = [sys.executable, "-m", "executive.cli", "run", "--robots", f"bob={kind}", "--say", say, "--json"]
    command += ["--no-record", "--seed", "1", "--out", str(out)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout.splitlines()[-1])


def test_fetch_is_read_with_its_wheels_head_arm_and_fingers(packages):
    folder, notes = packages
    data = read_yaml(folder / "published_fetch/errand_robot_published_fetch/robot.yaml").data
    assert data["base"]["motion"] == "differential" and data["head"] == ["head_pan_joint", "head_tilt_joint"]
    assert data["arm"]["joints"] == [f"{each[0]}_joint" for each in public_robots.FETCH_ARM]
    assert (
        data["gripper"]["widest"] == pytest.approx(0.1) and "lift torso_lift_joint is held" in notes["published_fetch"]
    )


def test_the_waffle_is_read_with_its_wheels_lidar_and_camera(packages):
    folder, _ = packages
    path = folder / "published_waffle/errand_robot_published_waffle/robot.yaml"
    data = read_yaml(path).data
    assert data["base"]["motion"] == "differential" and data["lidar"]["link"] == "base_scan" and "arm" not in data
    size_m = np.ptp(np.array(urdf_kind(path).capabilities().footprint_m), axis=0)
    assert size_m == pytest.approx([0.272, 0.306], abs=0.005)


@pytest.mark.nightly
@pytest.mark.mission
@pytest.mark.parametrize("kind", KINDS)
def test_it_visits_every_room_without_a_collision(installed, tmp_path, kind):
    report = report_of(installed, tmp_path, kind, "visit every room")
    assert report["outcome"] == "success" and report["referee"]["collisions"] == 0


@pytest.mark.nightly
@pytest.mark.mission
def test_fetch_brings_a_drink(installed, tmp_path):
    report = report_of(installed, tmp_path, "published_fetch", "can you fetch me a drink from the kitchen")
    assert report["outcome"] == "success" and report["referee"]["success"] and report["referee"]["drops"] == 0
