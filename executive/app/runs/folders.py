"""Folders of runs: each run has one of its own below a common folder, where the link `last` leads to the newest.

The file `run.json` of a folder says what was asked, when, and by which version; at the end it holds the report.
"""

from __future__ import annotations

import fcntl
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from importlib.metadata import version
from itertools import count
from pathlib import Path
from typing import Any, Final

from executive.mission.request import Request
from executive.store.database import form
from executive.words.slug import slug
from skills.inputs.errors import InputError
from skills.inputs.outside import writing

LAST: Final = "last"
FACTS: Final = "run.json"


@dataclass(frozen=True)
class KeptRun:
    """Run whose files are kept: its request, whose `out` is the run's folder, and its beginning (local time).

    The `report` has JSON values, and is None while the run goes on, or when its process was killed.
    """

    request: Request
    begun: datetime
    version: str
    report: Mapping[str, Any] | None = None

    @contextmanager
    def going_on(self) -> Iterator[None]:
        """Locks the folder against `remove_runs` during the block, or until the process dies."""
        with (self.request.out / FACTS).open() as file:
            fcntl.flock(file, fcntl.LOCK_SH)
            yield

    def end(self, report: Mapping[str, Any]) -> None:
        """Writes the report."""
        _write(replace(self, report=report))

    def undo(self) -> None:
        """Removes the folder of a run that could not begin; files of the run stay."""
        if [path.name for path in self.request.out.glob("*")] == [FACTS]:
            _remove(self.request.out.parent, [self.request.out])


def new_run(request: Request, now: datetime) -> KeptRun:
    """Creates the folder of a run below the folder `out` of its request, and the link `last`.

    Raises InputError if the folder cannot be written.
    """
    begun = now.astimezone().replace(microsecond=0)
    name = f"{begun:%Y-%m-%d-%H%M}-{slug(request.name)}"
    with writing(request.out, "name another --out"):
        for number in count(1):
            folder = request.out / (name if number == 1 else f"{name}-{number}")
            if not folder.exists():
                break
        folder.mkdir(parents=True)
        kept = KeptRun(replace(request, out=folder), begun, version("spot-errand"))
        _write(kept)
        last = request.out / LAST
        if last.is_symlink() or not last.exists():
            (link := request.out / f".{LAST}").unlink(missing_ok=True)
            link.symlink_to(folder.name)
            link.replace(last)
    return kept


def holds_run(folder: Path) -> bool:
    """Returns whether a folder is that of a run."""
    return (folder / FACTS).is_file()


def kept_run(folder: Path) -> KeptRun:
    """Reads the run of a folder, or of the folder that a link leads to. Raises InputError if it holds none."""
    file = folder.resolve() / FACTS
    try:
        kept: KeptRun = form(KeptRun).validate_json(file.read_bytes())
    except OSError as error:
        raise InputError("it holds no run", hint="`errand runs` lists the runs", file=folder) from error
    except ValueError as error:
        raise InputError(f"it is damaged ({type(error).__name__})", hint="remove its folder", file=file) from error
    return replace(kept, request=replace(kept.request, out=folder.resolve()))


def kept_runs(out: Path) -> list[KeptRun]:
    """Returns the runs below a folder, the oldest first. Raises InputError without a folder, or for a damaged run."""
    if not out.is_dir():
        raise InputError("there is no folder of runs", hint="begin a run, or name its folder by --out", file=out)
    found = [kept_run(file.parent) for file in out.glob(f"*/{FACTS}") if not file.parent.is_symlink()]
    return sorted(found, key=lambda kept: (kept.begun, kept.request.out.name))


def remove_runs(out: Path, older_than: timedelta, now: datetime) -> tuple[list[Path], list[Path]]:
    """Removes the folders of runs that began before a time; returns these, and those of runs that still go on."""
    older = [kept.request.out for kept in kept_runs(out) if now - kept.begun > older_than]
    stay = [folder for folder in older if _is_locked(folder)]
    _remove(out, removed := [folder for folder in older if folder not in stay])
    return removed, stay


def _is_locked(folder: Path) -> bool:
    """Returns whether a process runs in a folder."""
    with (folder / FACTS).open() as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def _remove(out: Path, folders: Iterable[Path]) -> None:
    """Removes folders of runs; if `last` led to one of them, it leads to the newest run that is left, or is removed."""
    for folder in folders:
        shutil.rmtree(folder)
    if (last := out / LAST).is_symlink() and not last.exists():
        last.unlink()
        with suppress(InputError, IndexError):  # a run cannot be read, or none is left
            last.symlink_to(kept_runs(out)[-1].request.out.name)


def _write(kept: KeptRun) -> None:
    text = form(KeptRun).dump_json(kept, exclude_defaults=True, indent=1).decode()
    (kept.request.out / FACTS).write_text(text + "\n", encoding="utf-8")
