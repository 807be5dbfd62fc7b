"""`python -m errand_train.speech`."""

from errand_train.speech import __main__ as training
from errand_train.speech import extra


def test_without_torch_the_mend_is_told(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(extra, "find_spec", lambda name: None)
    monkeypatch.setattr("sys.argv", ["training", "--out", str(tmp_path / "a.npz")])
    assert training.main() == 2
    assert "spot-errand[speech,train]" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
