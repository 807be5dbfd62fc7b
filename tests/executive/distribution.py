"""A distribution of plug-ins, as an installer leaves it."""

import sys
from contextlib import contextmanager
from importlib.metadata import entry_points


def write_distribution(folder, name, group, *lines, summary="Plug-ins."):
    """Writes the metadata of a distribution that registers entry points of a group."""
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\nSummary: {summary}\n")
    (info / "entry_points.txt").write_text("\n".join((f"[{group}]", *lines, "")))


@contextmanager
def module_of_a_plug_in(folder, monkeypatch, name, group, text):
    """Writes a module, and yields a function that registers entry points of it in a group; they are found anew."""
    (folder / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setattr("skills.inputs.plugins._all_installed", entry_points)
    yield lambda *lines: write_distribution(folder, name, group, *lines)
    sys.modules.pop(name, None)
