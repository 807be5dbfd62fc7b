"""`errand missions` and `errand init` list and copy the shipped missions."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Annotated, Final

import typer

from executive.app.prepare.mission_files import FOLDER, shipped_missions
from executive.cli.output import console_for, show_table
from executive.words.steps import add_tasks
from skills.inputs.outside import writing

_SCHEMA: Final = "mission.schema.json"


def missions() -> None:
    """Lists the missions that come with Errand."""
    rows = [(name, _first_words(file)) for name, file in shipped_missions().items()]
    show_table(console_for(as_json=False), ("mission", "what it shows"), rows)


def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder for the missions.", show_default=False)],
) -> None:
    """Copies the missions that come with Errand, and their schema with the installed tasks; existing missions stay."""
    with writing(folder, "name another folder"):
        folder.mkdir(parents=True, exist_ok=True)
        new = [file for file in sorted(FOLDER.glob("*.[yj]*")) if not (folder / file.name).exists()]
        for file in new:
            shutil.copyfile(file, folder / file.name)
        for file in FOLDER.glob(_SCHEMA):  # `make env` makes it in a clone
            schema = json.loads(file.read_text(encoding="utf-8"))
            add_tasks(schema["$defs"]["Do"])
            (folder / _SCHEMA).write_text(f"{json.dumps(schema, indent=2, ensure_ascii=False)}\n", encoding="utf-8")
    first = folder / next(iter(shipped_missions().values())).name
    console_for(as_json=False).print(f"{len(new)} files in {folder}; try: errand run {first}", markup=False)


def _first_words(file: Path) -> str:
    """Returns the text of the first comment line in a mission file."""
    lines = file.read_text(encoding="utf-8").splitlines()
    return next((line[1:].strip() for line in lines if line[:1] == "#" and "$schema=" not in line), "")
