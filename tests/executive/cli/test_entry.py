"""What each command imports: the heavy libraries only where they are used."""

import os
import subprocess
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path

import pytest

from executive.cli.entry import COMMANDS, EXIT_CODES, shipped_command
from executive.words.forms import OptionGroup
from tests.executive.cli.calls import done, errand

MISSIONS = Path(__file__).parents[3] / "missions"
HEAVY = {"pydrake", "spacy", "onnxruntime", "cv2", "numba", "scipy"}

CHECK = ("check", str(MISSIONS / "fetch_drink.yaml"))

# Commands that one process calls one after the other, and which heavy libraries it has imported after each.
IMPORTS = [
    [
        (("--help",), ""),
        (("run", "--help"), ""),
        (("run", "--wake", "--say", "get a beer"), ""),
        (("evaluate", "--help"), ""),
        (("log", "--help"), ""),
        (("new", "skill", "--help"), ""),
        (("parse", "--open", "fetch me a drink"), "spacy"),
        (("parse", "Hey Alice, fetch me a drink"), "spacy"),
    ],
    [(("queue", "--help"), "pydrake"), (("queue", "add", "--wake", "--say=go"), "pydrake"), (CHECK, "cv2 pydrake")],
]
PROGRAM = f"""
import sys
from importlib.metadata import entry_points
from executive.cli.entry import command_line
for words in %r:
    sys.argv = ["errand", *words]
    try:
        command_line()
    except SystemExit as end:
        assert end.code == 2 * ("--wake" in words), end.code
    tasks = ("errand_home", "errand_people")
    assert not [name for name in sys.modules if name.startswith("errand_") and not name.startswith(tasks)]
    print("imported:", *sorted({{name.split(".")[0] for name in sys.modules}} & {HEAVY!r}))
print(*sorted(name for name in sys.modules if name.startswith("executive.language.")))
print(*sorted({{entry.module for entry in entry_points(group="errand.skills")}} & sys.modules.keys()))
"""


@pytest.fixture(scope="module")
def call_in_process(tmp_path_factory):
    """Calls commands once in a process of their own; returns its lines and errors. The paths of `check` are planned."""
    environment = {"XDG_CACHE_HOME": str(tmp_path_factory.mktemp("cache"))}
    done(*CHECK, env=environment)

    @cache
    def call(commands):
        command, variables = [sys.executable, "-c", PROGRAM % (commands,)], {**os.environ, **environment}
        run = subprocess.run(command, capture_output=True, text=True, check=True, env=variables)
        return run.stdout.splitlines(), run.stderr

    return call


@pytest.mark.parametrize("calls", IMPORTS)
def test_a_command_imports_no_heavy_library_that_it_does_not_use(call_in_process, calls):
    lines, errors = call_in_process(tuple(words for words, _ in calls))
    imported = [line.removeprefix("imported:").strip() for line in lines if line.startswith("imported:")]
    assert imported == [libraries for _, libraries in calls]
    assert errors.count("--no-wake") == sum("--wake" in words for words, _ in calls)


def test_a_check_imports_nothing_that_understands_sentences_and_only_skills_of_the_mission(call_in_process):
    language, skills = (line.split() for line in call_in_process(tuple(words for words, _ in IMPORTS[1]))[0][-2:])
    assert language == [f"executive.language.{name}" for name in ("lexicon", "parser", "questions")]
    assert {"skills.navigate.skill", "skills.manipulation.grasp.skill"} < set(skills)
    assert not {"skills.small.speak", "skills.small.doors"} & set(skills)
    assert not [name for name in skills if name.startswith("skills.people.")]


@pytest.mark.parametrize(("arguments", "code"), [(["--help"], 0), (["parse"], 2)])
def test_the_process_ends_with_its_exit_status_after_threads_and_exit_handlers(arguments, code):
    program = (
        "import atexit, sys, threading; from executive.cli.entry import main\n"
        f"sys.argv = ['errand', *{arguments!r}]\n"
        "atexit.register(print, 'handled')\n"
        "threading.Timer(0.1, print, ['worked']).start()\n"
        "main()"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    lines = run.stdout.splitlines()
    assert (run.returncode, "worked" in lines, lines[-1]) == (code, True, "handled")


@pytest.mark.parametrize(
    ("words", "value"),
    [
        (["--start", "unknown"], "unknown"),
        (["--start", "1.5", "-2", "3e-1"], "1.5 -2 3e-1"),
        (["--start", "-1", "2", "0", "--quiet"], "-1 2 0"),
        (["--quiet"], None),
    ],
)
def test_a_start_is_one_word_or_three_numbers(words, value):
    command = shipped_command("run")
    context = command.make_context("run", ["missions/go_to_pose.yaml", *words])
    assert (context.params["start"], str(context.params["file"])) == (value, "missions/go_to_pose.yaml")


@pytest.mark.parametrize(
    ("words", "value"),
    [
        (["--quiet"], None),
        (["--view"], 1e9),
        (["--view", "--quiet"], 1e9),
        (["--view", "3.5"], 3.5),
        (["--view=0"], 0.0),
    ],
)
def test_a_view_has_a_time_or_stays_until_the_user_ends_it(words, value):
    context = shipped_command("run").make_context("run", [*words, "missions/go_to_pose.yaml"])
    assert (context.params["view"], str(context.params["file"])) == (value, "missions/go_to_pose.yaml")


def test_the_version_is_that_of_the_distribution():
    assert errand("--version").stdout == f"errand {version('spot-errand')}\n"


@pytest.mark.parametrize(
    ("typed", "offered"),
    [("errand ru", "run"), ("errand run --sa", "--say"), ("errand world fr", "from-map"), ("errand queue ", "serve")],
)
def test_the_shell_completes_commands_and_options(typed, offered, monkeypatch):
    monkeypatch.setenv("_ERRAND_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", typed)
    monkeypatch.setenv("COMP_CWORD", str(len(typed.split(" ")) - 1))
    assert offered in errand(prog_name="errand").stdout.split()


def test_completion_is_installed_for_a_shell(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr("typer.completion._get_shell_name", lambda: "fish", raising=False)
    monkeypatch.setattr("typer._completion_shared._get_shell_name", lambda: "fish", raising=False)
    done("--install-completion", prog_name="errand")
    assert "_ERRAND_COMPLETE" in (tmp_path / ".config/fish/completions/errand.fish").read_text()


@pytest.mark.parametrize("command", [[], *([name] for name in COMMANDS), ["queue", "add"], ["world", "from-map"]])
def test_every_help_ends_with_the_exit_codes_and_only_the_root_installs_completion(command):
    shown = errand(*command, "--help", env={"COLUMNS": "200"}).stdout
    assert " ".join(shown.split()).endswith(EXIT_CODES)
    assert ("--install-completion" in shown) == (not command)


def test_the_help_of_run_has_a_heading_for_each_group_of_options():
    shown = errand("run", "--help").stdout
    headings = [line.removesuffix(":") for line in shown.splitlines() if line.endswith(":") and line[:1].isupper()]
    assert headings == ["Arguments", *OptionGroup, "Options"]
    assert shown.index("Robots:") < shown.index("--stack") < shown.index("Faults and variations:")
