"""Which Errand is installed here: equal on two machines only where their runs are equal."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

__all__ = ["installed_code"]

_ROOT: Final = Path(__file__).resolve().parents[3]
_PACKAGES: Final = ("executive", "skills", "plant", "missions")
_LIBRARIES: Final = ("drake", "numpy", "numba", "onnxruntime", "ompl", "opencv-python-headless", "scipy")
_LETTERS: Final = 12


@cache
def installed_code() -> str:
    """The version, and a hash of all files of the code, the models and the worlds, and of the libraries' versions."""
    made = hashlib.sha256()
    for package in _PACKAGES:
        for path in sorted((_ROOT / package).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts and path.suffix != ".pyc":
                made.update(path.relative_to(_ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    for library in _LIBRARIES:
        made.update(f"{library} {_version(library)}\n".encode())
    return f"{_version('spot-errand')}+{made.hexdigest()[:_LETTERS]}"


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
