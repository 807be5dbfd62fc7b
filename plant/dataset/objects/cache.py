"""Where made models are kept: in the user's cache, by the digest of the sources that make them."""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

_SOURCES = ("dataset/objects", "models/builder")


@cache
def sources_digest() -> str:
    """Ten hexadecimal digits that change whenever a source of the models does."""
    plant = Path(__file__).resolve().parents[2]
    digest = hashlib.sha256()
    for path in sorted(
        path for folder in _SOURCES for path in (plant / folder).rglob("*") if path.suffix in (".py", ".yaml")
    ):
        digest.update(path.relative_to(plant).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:10]


def cache_folder() -> Path:
    """The folder for models; `ERRAND_MODEL_CACHE` names another place than the user's cache."""
    chosen = os.environ.get("ERRAND_MODEL_CACHE")
    if chosen:
        return Path(chosen) / sources_digest()
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return home / "errand" / "models" / sources_digest()


def kept_folder(folder: Path, fill: Callable[[Path], None]) -> Path:
    """The folder, filled once by `fill`; it appears only when complete, whoever else makes the same meanwhile."""
    if folder.is_dir():
        return folder
    folder.parent.mkdir(parents=True, exist_ok=True)
    fresh = Path(tempfile.mkdtemp(prefix=".making-", dir=folder.parent))
    try:
        fill(fresh)
        fresh.chmod(0o755)
        fresh.rename(folder)
    except OSError:
        if not folder.is_dir():
            raise
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    return folder
