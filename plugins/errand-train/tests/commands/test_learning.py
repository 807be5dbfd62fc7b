import pytest

from errand_train import libraries
from tests.executive.cli.calls import errand


@pytest.fixture(params=["train", "refine"])
def command(request):
    """Each of the commands that train a network."""
    return str(request.param)


def run(*words):
    return errand("dataset", *words)


def test_without_torch_the_extra_is_named(command, data, tmp_path, monkeypatch):
    monkeypatch.setattr(libraries.importlib.util, "find_spec", lambda _name: None)
    result = run(command, "--data", str(data), "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert "torch and onnx" in result.stderr
    assert "make train" in result.stderr


def test_a_folder_that_is_no_data_set_is_named(command, tmp_path):
    result = run(command, "--data", str(tmp_path), "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert "train.json" in result.stderr
    assert "errand dataset render" in result.stderr


def test_minutes_and_epochs_together_are_refused(command, data, tmp_path):
    result = run(command, "--data", str(data), "--out", str(tmp_path / "out"), "--minutes", "1", "--epochs", "1")
    assert result.exit_code == 2
    assert "--minutes and --epochs" in result.stderr


def test_a_training_that_is_there_already_is_not_overwritten(command, data, tmp_path):
    (tmp_path / "checkpoint.pt").write_bytes(b"kept")
    result = run(command, "--data", str(data), "--out", str(tmp_path))
    assert result.exit_code == 2
    assert "--resume" in result.stderr
    assert (tmp_path / "checkpoint.pt").read_bytes() == b"kept"


def test_a_proposal_network_that_is_not_there_is_named(data, tmp_path, monkeypatch):
    monkeypatch.setattr(libraries.importlib.util, "find_spec", lambda _name: object())
    missing = tmp_path / "missing.onnx"
    result = run("refine", "--data", str(data), "--out", str(tmp_path / "out"), "--model", str(missing))
    assert result.exit_code == 2
    assert "missing.onnx" in result.stderr
    assert "--model" in result.stderr
