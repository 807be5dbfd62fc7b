"""New folders that appear only when all their files are written."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from skills.inputs.errors import InputError
from skills.inputs.outside import writing


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """Yields a temporary folder, and copies it to a new folder when the block ends without an error.

    Raises InputError if the new folder exists and is not empty, or cannot be written.
    """
    with writing(out, "name another --out"):
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise InputError("it exists already", hint="name a new folder by --out", file=out)
        out.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=out.parent, prefix=f".{out.name}-") as folder:
            yield Path(folder)
            shutil.copytree(folder, out, dirs_exist_ok=True)
