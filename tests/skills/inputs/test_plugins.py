"""Plug-ins: their errors become one error, and one that hangs ends the process with its name."""

import subprocess
import sys
import threading
import time
import tomllib
from importlib.metadata import EntryPoint

import pytest

from skills.inputs.plugins import PluginDefect, missing_plugin, run_in_thread, run_plugin
from skills.inputs.yaml_source import read_yaml
from tests.sources import ROOT

ENTRY = EntryPoint("wave", "wavers:Wave", "errand.skills")
HANGS = """
from importlib.metadata import EntryPoint
from skills.inputs.plugins import run_plugin
import time
run_plugin(EntryPoint("wave", "wavers:Wave", "errand.skills"), lambda: time.sleep(60), limit_s=0.2)
"""


class Odd(Exception):  # noqa: N818
    """Its text is none."""

    def __str__(self):
        raise ValueError


def raising(defect):
    def call():
        raise defect

    return call


@pytest.mark.parametrize(
    ("defect", "words"),
    [
        (SystemExit(3), "SystemExit: 3"),
        (BaseException("gone"), "BaseException: gone"),
        (type("Ends", (KeyboardInterrupt,), {})("now"), "Ends: now"),
        (Odd(), "Odd: without a text"),
        (ValueError("x" * 10_000), "ValueError: x{300}$"),
    ],
)
def test_any_error_of_a_plug_in_becomes_one_defect(defect, words):
    with pytest.raises(PluginDefect, match=words):
        run_plugin(ENTRY, raising(defect))


def test_ctrl_c_during_an_import_passes_through():
    with pytest.raises(KeyboardInterrupt):
        run_plugin(ENTRY, raising(KeyboardInterrupt()))


def test_a_call_that_ends_in_time_does_not_end_the_process_later():
    assert run_plugin(ENTRY, lambda: 3, limit_s=0.05) == 3
    time.sleep(0.2)


def test_an_import_that_hangs_ends_the_process_with_one_line():
    begun = time.monotonic()
    ended = subprocess.run([sys.executable, "-c", HANGS], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout) == (2, "")
    what = "errand.skills 'wave' (wavers:Wave) of distribution an unknown distribution is not loaded within 0.2 s"
    assert ended.stderr == f"errand: {what}; repair or uninstall that distribution\n"
    assert time.monotonic() - begun < 40.0


def test_a_call_in_a_thread_returns_its_result_or_raises_a_defect():
    assert run_in_thread(lambda: 3, limit_s=10.0) == 3
    with pytest.raises(PluginDefect, match="SystemExit: 3"):
        run_in_thread(raising(SystemExit(3)), limit_s=10.0)


def test_a_call_in_a_thread_that_hangs_is_abandoned():
    over = threading.Event()
    with pytest.raises(PluginDefect, match=r"not done within 0\.05 s"):
        run_in_thread(lambda: over.wait(10), limit_s=0.05)
    over.set()


def test_a_name_of_a_plug_in_that_is_missing_is_told_with_how_to_install_it():
    assert missing_plugin("errand.tasks", "follow") == (
        "'follow' needs the plug-in errand-people, which is not installed",
        "pip install errand-people",
    )
    assert missing_plugin("errand.tasks", "unheard") is None


def test_the_table_of_plug_ins_has_what_they_register():
    for name, groups in read_yaml(ROOT / "skills" / "inputs" / "plugins.yaml").data.items():
        project = tomllib.loads((ROOT / "plugins" / name / "pyproject.toml").read_text())["project"]
        assert {group: sorted(project["entry-points"][group]) for group in groups} == groups
