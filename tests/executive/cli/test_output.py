"""What becomes of errors on the command line: one line, exit status 2."""

import pytest
import typer
from typer.testing import CliRunner

from executive.cli import entry
from executive.cli.output import refuse


@pytest.mark.parametrize("option", ["--out", "--store", "--stack", "--world", ""])
def test_a_name_of_endless_length_is_refused_in_one_line(option):
    name = "a" * 15_000
    file = [] if option == "" else ["go_to_pose"]
    result = CliRunner().invoke(entry.app, ["queue", "add", *file, *filter(None, [option]), name])
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert result.stderr.startswith("errand: ") and len(result.stderr) < 1500


def test_an_error_that_is_no_fault_of_a_name_is_raised():
    with pytest.raises(OSError, match="wire"):
        refuse(OSError("the wire is cut"))


def test_a_folder_that_cannot_be_written_is_named(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    with pytest.raises(NotADirectoryError) as found:
        (tmp_path / "file" / "below").mkdir()
    with pytest.raises(typer.Exit):
        refuse(found.value)
    assert "file/below: cannot use it (Not a directory); name another" in capsys.readouterr().err
