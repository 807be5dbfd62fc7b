"""Writes what a benchmark has measured to `docs/figures`, from where the pages quote it."""

import json
import os
import platform
import shlex
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "figures"
_SEEDS = ("seed", "seeds", "first", "count", "trials")


def write_figures(name, values, options, folder=FOLDER):
    """Writes figures with their command, commit, date, machine and seeds; returns the file.

    `options` are those of the benchmark; those that choose seeds are stored as seeds. `name` may have a note.
    """
    words = [word for word in sys.argv[1:] if word not in ("--figures", name)]
    chosen = {key: str(value) for key, value in options.items() if key in _SEEDS}
    data = {
        "command": shlex.join(["python", *_program(Path(sys.argv[0])), *words]),
        "commit": _commit(),
        "date": datetime.now(UTC).date().isoformat(),
        "machine": f"{os.cpu_count()} cores, {platform.machine()}, {platform.system()}",
        "seeds": ", ".join(f"{key} {value}" for key, value in chosen.items()) or None,
        "values": values,
    }
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{name}.json"
    file.write_text(json.dumps(data, indent=1, ensure_ascii=False, default=str) + "\n", encoding="utf-8")
    return file


def _program(path):
    """Arguments of Python that run a benchmark: its module, or the file in a plug-in."""
    if "plugins" in path.parts:
        return [Path(*path.parts[path.parts.index("plugins") :]).as_posix()]
    return ["-m", f"tests.benchmarks.{path.stem if path.suffix == '.py' else path.name}"]


def _commit():
    """The revision that was measured, with a mark when files differ from it; None outside a checkout."""
    said = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True)
    return said.stdout.strip() or None
