"""What becomes of errors on the command line: one line, exit status 2."""

import errno
import io
import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console

from executive.cli.output import progress_bar, refuse
from skills.inputs.errors import InputError, Problems
from tests.executive.cli.calls import errand

ERRAND = [sys.executable, "-m", "executive.cli"]
_GONE = "errand: the folder in which it was called is removed; go to another one by cd\n"


@pytest.mark.parametrize("option", ["--out", "--store", "--stack", "--world", ""])
def test_a_name_of_endless_length_is_refused_in_one_line(option):
    name = "a" * 15_000
    file = [] if option == "" else ["go_to_pose"]
    result = errand("queue", "add", *file, *filter(None, [option]), name)
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert result.stderr.startswith("errand: ") and len(result.stderr) < 1500


def test_of_many_errors_the_first_are_shown_and_the_rest_counted(capsys):
    problems = Problems()
    for number in range(2000):
        problems.add(InputError(f"wrong {number}"))
    with pytest.raises(InputError) as caught:
        problems.raise_any()
    with pytest.raises(SystemExit):
        refuse(caught.value)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) < 100
    assert lines[0] == "errand: wrong 0"
    assert lines[-1] == f"errand: and {2000 - len(lines) + 1} more; mend these first"


def test_an_error_that_is_no_fault_of_a_name_is_raised():
    with pytest.raises(OSError, match="wire"):
        refuse(OSError("the wire is cut"))


def test_a_folder_that_cannot_be_written_is_named(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    with pytest.raises(NotADirectoryError) as found:
        (tmp_path / "file" / "below").mkdir()
    with pytest.raises(SystemExit):
        refuse(found.value)
    assert "file/below: cannot use it (Not a directory); name another" in capsys.readouterr().err


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EFBIG, errno.EMFILE])
def test_a_lack_of_the_machine_is_one_line_that_says_what_is_lost(number, capsys):
    with pytest.raises(SystemExit) as ended:
        refuse(OSError(number, "no"))
    line = capsys.readouterr().err
    assert (ended.value.code, line.count("\n")) == (2, 1)
    assert "what this command was writing is lost or incomplete; make room" in line


@pytest.mark.parametrize("words", [["--version"], ["--help"], ["missions"], ["parse", "go to the kitchen", "--json"]])
def test_a_result_that_cannot_be_written_is_one_line(words):
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run([*ERRAND, *words], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (ended.returncode, ended.stderr.splitlines()[-1][:24]) == (2, "errand: the disk is full")
    assert "Traceback" not in ended.stderr


def test_a_process_says_that_its_folder_is_removed(tmp_path):
    gone = tmp_path / "gone"
    gone.mkdir()
    script = f'cd {gone} && rmdir {gone} && exec "$@"'
    called = ["sh", "-c", script, "sh", *ERRAND, "parse", "go to the kitchen"]
    ended = subprocess.run(called, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (2, _GONE)


@pytest.mark.parametrize("words", [["run", "--say", "go"], ["queue", "list"], ["check", "patrol"], ["doctor"]])
def test_every_command_says_that_its_folder_is_removed(tmp_path, monkeypatch, words):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    result = errand(*words)
    assert (result.exit_code, result.stderr) == (2, _GONE)


@pytest.fixture
def terminal():
    return Console(file=io.StringIO(), force_terminal=True, width=100)


def test_a_bar_counts_steps_names_them_and_says_the_time_left(terminal):
    with progress_bar(terminal, "reading", 3) as advance:
        advance()
        advance("writing")
    shown = terminal.file.getvalue()
    assert "reading" in shown and "writing" in shown and "2/3" in shown and "left" in shown


def test_a_bar_counts_up_to_the_new_total_after_steps_were_added(terminal):
    with progress_bar(terminal, "missions", 2) as advance:
        advance(total=3)
    assert "1/3" in terminal.file.getvalue()


@pytest.mark.parametrize("total", [0, 1])
def test_a_single_step_has_no_bar(terminal, total):
    with progress_bar(terminal, "runs", total) as advance:
        advance("on")
    assert terminal.file.getvalue() == ""


def test_a_file_gets_no_bar():
    plain = Console(file=io.StringIO())
    with progress_bar(plain, "runs", 5) as advance:
        advance()
    assert plain.file.getvalue() == ""


# lines wanted, the lines without a terminal
@pytest.mark.parametrize(("lines", "told"), [(True, "1 of 3 runs: seed 1\n2 of 3 runs: seed 2\n"), (False, "")])
def test_without_a_terminal_a_line_for_each_step_is_shown_where_it_is_wanted(lines, told):
    console = Console(file=io.StringIO(), force_terminal=False)
    with progress_bar(console, "runs", 3, lines=lines) as advance:
        advance("seed 1")
        advance("seed 2")
    assert console.file.getvalue() == told
