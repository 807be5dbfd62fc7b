from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from errand_train import libraries
from executive.cli.entry import app


def run(*words: str) -> Result:
    return CliRunner().invoke(app, ["dataset", "refine", *words])


def test_a_proposal_network_that_is_not_there_is_named(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(libraries.importlib.util, "find_spec", lambda _name: object())
    missing = tmp_path / "missing.onnx"
    result = run("--data", str(data), "--out", str(tmp_path / "out"), "--model", str(missing))
    assert result.exit_code == 2
    assert "missing.onnx" in result.stderr
    assert "--model" in result.stderr
