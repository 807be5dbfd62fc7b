"""`errand doctor` finds what a run lacks, and names the mend."""

import re
import socket
import subprocess

import pytest

from executive.cli import doctor_command
from tests.executive.cli.calls import errand, json_of


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def ended(monkeypatch):
    """How a process that renders, or lists plug-ins, ends."""

    def as_told(returncode, stdout="", stderr=""):
        result = subprocess.CompletedProcess((), returncode, stdout, stderr)
        monkeypatch.setattr(doctor_command.subprocess, "run", lambda *_, **__: result)

    return as_told


def test_this_machine_is_fit_for_runs():
    result = errand("doctor", "--json")
    values = json_of(result)
    faults = [each for each in values["findings"] if each["good"] is False]
    assert (values["good"], faults, result.exit_code) == (True, [], 0)
    names = {each["name"] for each in values["findings"]}
    assert {"Python", "packages", "camera pictures", "compiled code", "plug-ins", "folder of runs"} <= names


def test_a_machine_that_cannot_render_is_told_the_debian_packages(ended):
    ended(-6, stderr="a\nFailed to initialize OpenGL functions!")
    (found,) = doctor_command._rendering()
    assert (found.good, found.text) == (False, "Failed to initialize OpenGL functions!")
    assert found.mend.startswith("as root: apt-get install libegl1 ")


def test_a_missing_package_is_named_with_the_way_to_get_it(monkeypatch):
    monkeypatch.setattr(
        doctor_command, "requires", lambda _: ["numpy>=2", "not-there<3; python_version > '3'", "x; extra == 'y'"]
    )
    (found,) = doctor_command._packages()
    assert (found.good, found.mend) == (False, "pip install not-there")


def test_a_port_in_use_is_a_note_and_no_fault():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        monkey = ((taken.getsockname()[1], "Foxglove"),)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(doctor_command, "_PORTS", monkey)
            (found,) = doctor_command._ports()
    assert (found.good, found.mend) == (None, "give Foxglove another port")


def test_a_broken_plug_in_is_named(ended):
    ended(1, '{"plugins": [{"name": "fly", "distribution": "wings", "broken": "no air"}]}')
    listed, broken = doctor_command._plugins()
    assert (listed.good, broken.name, broken.text) == (False, "plug-in fly", "no air")


def test_broken_defaults_are_a_fault(folder):
    (folder / "errand.toml").write_text("out = 3\n")
    (found,) = doctor_command._folder()
    assert found.good is False


def test_skills_are_listed_with_their_inputs():
    result = errand("skills", "--json")
    speak = next(each for each in json_of(result)["skills"] if each["skill"] == "speak")
    assert (speak["inputs"], speak["about"][:17]) == ({"text": "text"}, "Says a text once,")
    assert "stow" in errand("skills").stdout


#   arguments of a command, and lines that it prints (columns two spaces apart)
@pytest.mark.parametrize(
    ("words", "lines"),
    [
        (["skills", "speak"], ["speak: Says a text once", "text  text  required"]),
        (["skills", "stow"], ["PLANNING  failure  the arm finds no free path"]),
        (["stack", "show", "planner"], ["planner:", "use: lattice"]),
        (["stack", "show", "planner", "--options"], ["planner lattice: ", "margin_m  number from 0 to 10 m  0.06"]),
        (["stack", "show", "lattice", "--options"], ["planner lattice: "]),
        (["stack", "show", "onnx", "--options"], ["letterbox or corner or stretch or native or nothing", "file  path"]),
        (["stack", "show", "navigate", "--options"], ["skills navigate: ", "doors.reach_m  number above 0"]),
    ],
)
def test_one_skill_or_component_is_printed_whole(words, lines):
    shown = re.sub(r" {2,}", "  ", errand(*words).stdout)
    assert [line for line in lines if line not in shown] == []


@pytest.mark.parametrize("words", [["skills", "navigat"], ["stack", "show", "navigat", "--options"]])
def test_an_unknown_name_is_refused_with_the_nearest(words):
    ended = errand(*words)
    assert (ended.exit_code, ended.stderr) == (2, "errand: there is no 'navigat'; did you mean 'navigate'?\n")
