"""`python -m executive.speech.training`."""

from executive.speech.training import __main__ as training
from executive.speech.training import extra


def test_without_torch_the_mend_is_told(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(extra, "find_spec", lambda name: None)
    monkeypatch.setattr("sys.argv", ["training", "--out", str(tmp_path / "a.npz")])
    assert training.main() == 2
    assert "spot-errand[speech,train]" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
