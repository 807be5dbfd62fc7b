"""Commands of other distributions: listed, run, and refused in one line where they cannot be used."""

import re
import sys
from importlib.metadata import entry_points

import pytest

from executive.cli import entry
from executive.cli.entry import help_lines
from tests.executive.cli.calls import done, errand
from tests.executive.distribution import write_distribution
from tests.sources import PRODUCT, modules

MODULE = '''
import typer
from skills.inputs.errors import InputError

def count(ports: int = 3):
    """Counts ports.

    All of them.
    """
    if ports < 0:
        raise InputError("no ship has fewer than 0 ports", hint="give --ports 1")
    print("ports:", ports)

fleet = typer.Typer(help="Ships at sea.")

@fleet.command()
def sail():
    print("sailing")

@fleet.command()
def moor():
    print("moored")
'''

OURS = help_lines()


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Makes distributions that register commands, as an installer would leave them; they are found anew."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr("skills.inputs.plugins._all_installed", entry_points)

    def installed(name, commands, summary="Commands for ships."):
        write_distribution(tmp_path, name, "errand.commands", *commands, summary=summary)

    (tmp_path / "ships.py").write_text(MODULE)
    yield installed
    sys.modules.pop("ships", None)


def test_the_help_lists_a_command_of_another_distribution_and_imports_none_of_it(install):
    install("ships", ["ports = no_such_module:count"])
    ended = done("--help")
    line = next(line for line in ended.stdout.splitlines() if line.split()[:1] == ["ports"])
    assert "Commands for ships." in line


def test_a_function_becomes_a_command_with_its_options(install):
    install("ships", ["ports = ships:count"])
    assert done("ports", "--ports", "5").stdout == "ports: 5\n"


def test_a_typer_app_becomes_a_group_of_commands(install):
    install("ships", ["ships = ships:fleet"])
    assert errand("ships", "sail").stdout == "sailing\n"


def test_a_command_refuses_bad_input_in_one_line_by_raising_an_input_error(install):
    install("ships", ["ports = ships:count"])
    ended = errand("ports", "--ports", "-1")
    assert (ended.exit_code, ended.stderr) == (2, "errand: no ship has fewer than 0 ports; give --ports 1\n")


@pytest.mark.parametrize(
    ("value", "why"),
    [
        ("no_such_module:count", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("ships:MODULE", "AttributeError"),
        ("ships:typer", "it is neither a typer.Typer nor a function"),
    ],
)
def test_a_broken_command_is_refused_in_one_line_that_names_its_distribution(install, value, why):
    install("ships", [f"ports = {value}"])
    ended = errand("ports")
    assert (ended.exit_code, len(ended.stderr.splitlines())) == (2, 1)
    assert f"cannot load command 'ports' ({value}) of ships: " in ended.stderr
    assert why in ended.stderr


def test_a_command_that_two_distributions_register_is_refused(install):
    install("ships", ["ports = ships:count"])
    install("docks", ["ports = ships:fleet"])
    ended = errand("ports")
    assert ended.exit_code == 2
    assert ended.stderr == "errand: docks and ships both have a command 'ports'; uninstall one of them\n"


def test_a_command_of_errand_is_not_replaced_by_one_of_its_name(install):
    install("ships", ["missions = ships:count"])
    assert "fetch_drink" in errand("missions").stdout


@pytest.fixture
def nothing_installed(monkeypatch):
    monkeypatch.setattr("skills.inputs.plugins.installed_plugins", lambda _group: ())
    monkeypatch.setattr("executive.cli.entry._text", lambda _file: "")
    kept = entry.shipped_command  # by conftest.py, with the commands that another test has loaded
    monkeypatch.setattr(entry, "shipped_command", getattr(kept, "__wrapped__", kept))


def test_the_help_lists_a_command_with_the_help_in_its_source_which_does_not_run(install):
    install("ships", ["ports = ships:count", "armada = ships:fleet", "lost = ships:nothing"])
    lines = help_lines()
    assert {name: lines[name] for name in ("ports", "armada", "lost")} == {
        "ports": "Counts ports.",
        "armada": "Ships at sea.",
        "lost": "Commands for ships.",
    }


def test_the_help_lists_each_command_of_our_plug_ins_with_a_help_of_its_own():
    assert len(set(OURS.values())) == len(OURS) >= 9
    shown = errand("--help", env={"COLUMNS": "200"}).stdout
    assert [line for name, line in OURS.items() if "." not in name and line[:50] not in shown] == []


def test_an_unknown_command_is_refused_with_the_page_that_names_the_plug_ins(nothing_installed):
    ended = errand("world", "show", "flat")
    assert ended.exit_code == 2
    assert "No such command 'world'. Plug-ins bring more commands: docs/how-to/commands.md names them." in ended.stderr


@pytest.mark.parametrize("typed", ["errand world sh", "errand object im"])
def test_completion_below_a_missing_plug_in_shows_no_error(typed, nothing_installed, monkeypatch):
    monkeypatch.setenv("_ERRAND_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", typed)
    monkeypatch.setenv("COMP_CWORD", str(len(typed.split(" ")) - 1))
    ended = errand(prog_name="errand")
    assert (ended.exception is None or isinstance(ended.exception, SystemExit), ended.stderr) == (True, "")


def test_a_plug_in_adds_a_command_to_a_group_of_errand(install):
    install("ships", ["new.ship = ships:count"])
    assert "ship" in errand("new", "--help").stdout
    ended = errand("new", "ship", "--ports", "2")
    assert (ended.stdout, ended.stderr) == ("ports: 2\n", "")


NAMED = re.compile(r"(?:`|: |by )errand ([a-z][a-z0-9-]*)")


def test_each_command_that_a_message_of_the_core_names_exists():
    named = {word for text in modules(*PRODUCT).values() for word in NAMED.findall(text)}
    assert {"world", "object", "map", "dataset", "run"} <= named
    assert named <= {*entry.COMMANDS, *OURS}
