"""`python -m errand_train.speech`."""

from errand_train.speech import __main__ as training


def test_without_torch_the_command_to_install_it_is_named(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    monkeypatch.setattr("sys.argv", ["training", "--out", str(tmp_path / "a.npz")])
    assert training.main() == 2
    assert "training needs torch; pip install" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
