"""`errand object` imports a mesh as a model for worlds and missions, and shows imported models."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from executive.cli.number_options import quantity_argument, quantity_option
from executive.cli.options import AS_JSON
from executive.cli.output import console_for, new_folder, print_json, writing
from plant.models.catalogue import ImportedObject, read_imported
from skills.files.errors import InputError, count_text
from skills.perception.class_forms import class_forms
from skills.quantities import Factor, Mass, TagNumber, TagSize

PICTURE_PX = (640, 480)

object_group = typer.Typer(name="object", help="Objects of your own, from any mesh.", rich_markup_mode=None)


@object_group.callback()
def _group() -> None:
    """Objects of your own, from any mesh."""


@object_group.command(name="import")
def import_command(
    mesh: Annotated[
        Path, typer.Argument(metavar="MESH", help="A closed mesh: OBJ, STL, PLY, OFF, glTF, GLB, COLLADA or 3MF.")
    ],
    name: Annotated[str, typer.Option(help="Name of the model in worlds: letters, digits and _.")],
    mass: Annotated[float | None, quantity_option(Mass, help="Mass, kg; by default by its volume.")] = None,
    out: Annotated[Path | None, typer.Option("--out", help="New folder for the model; by default its name.")] = None,
    class_name: Annotated[
        str | None,
        typer.Option(
            "--class", help="The class that the detector reports for it; by default the robot knows its model."
        ),
    ] = None,
    scale: Annotated[
        float,
        quantity_option(
            Factor, help="Metres per unit of the file; 0.001 for millimetres. COLLADA and 3MF name theirs."
        ),
    ] = 1.0,
    up: Annotated[
        str | None,
        typer.Option(
            help="Upward axis of the file: x, y or z. By default z; for glTF y, for COLLADA as the file says."
        ),
    ] = None,
    close_holes: Annotated[bool, typer.Option("--close-holes", help="Close the holes of an open mesh.")] = False,
    as_json: AS_JSON = False,
) -> None:
    """Imports a mesh as a model: visual geometry, convex collision parts, and inertia from volume and mass."""
    from plant.models.builder.importing import ImportOptions, ImportReports, import_object

    wanted = ImportOptions(name, mass, class_name, scale, up, close_holes)
    with _refused():
        wanted.check()
    out = Path(name) if out is None else out
    notes = list[str]()
    with _refused(mesh), new_folder(out) as folder, _bar() as step:
        made = import_object(mesh, wanted, folder, ImportReports(step, notes.append))
    for note in notes:
        typer.echo(f"errand: warning: {mesh}: {note}", err=True)
    if (doubt := _unlike_its_class(made)) is not None:
        typer.echo(f"errand: warning: {doubt}", err=True)
    if as_json:
        print_json(_facts(made, out))
    else:
        typer.echo(f"{out}: {_in_words(made)}")


@object_group.command()
def show(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of `errand object import`.")],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Draw the model into this PNG file.")] = None,
    as_json: AS_JSON = False,
) -> None:
    """Shows an imported model: extents, mass, inertia, collision parts."""
    found = read_imported(folder)
    if out is not None:
        _draw(folder, found, out)
    if as_json:
        print_json(_facts(found, folder))
        return
    typer.echo(f"{found.name}: class {_class_of(found)}")
    typer.echo(f"extents (m)       {_numbers(found.size_m)}")
    typer.echo(f"mass (kg)         {found.mass_kg:g}")
    typer.echo(f"centre of mass    {_numbers(found.com_m)}")
    typer.echo(f"inertia (kg m^2)  {_numbers(found.inertia_kg_m2)} (xx yy zz xy xz yz)")
    typer.echo(f"collision parts   {found.collision_parts}")
    typer.echo(f"triangles         {found.triangles}")


@object_group.command()
def tag(
    number: Annotated[int, quantity_argument(TagNumber, metavar="ID", help="Number of the tag in the family 36h11.")],
    out: Annotated[Path, typer.Option("--out", help="SVG file to print, or a new folder for the plate of a world.")],
    size: Annotated[float, quantity_option(TagSize, help="Side of the black square, m.")] = 0.1,
    on: Annotated[
        Path | None, typer.Option("--on", metavar="DIR", help="Imported model that carries the tag, too.")
    ] = None,
    side: Annotated[str, typer.Option(help="Its side: front, back, left, right or top.")] = "front",
) -> None:
    """Draws an AprilTag to print, or makes its plate for a world; sticks it on an imported model, too."""
    from plant.models.builder.tags import stick_on, tag_svg, write_plate

    if on is not None:
        with _refused(on):
            stick_on(on, number, size, side)
    if out.suffix.lower() == ".svg":
        with writing(out):
            out.write_text(tag_svg(number, size), encoding="utf-8")
    else:
        with new_folder(out) as folder:
            write_plate(folder, number, size)
    carrier = f"on: {read_imported(on).class_name}" if on is not None else "at: [x, y, z], yaw: 0.0"
    typer.echo(f"{out}: for knowledge.yaml, under 'tags': {{id: {number}, size: {size:g}, {carrier}}}")


@contextmanager
def _bar() -> Iterator[Callable[[str], None]]:
    """Shows a progress bar over the steps of an import, at a terminal."""
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    from plant.models.builder.importing import STEPS

    console = console_for(as_json=True)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(STEPS[0], total=len(STEPS))
        yield lambda step: bar.update(task, description=step, completed=STEPS.index(step))


@contextmanager
def _refused(mesh: Path | None = None) -> Iterator[None]:
    """Raises InputError for a mesh that cannot be imported."""
    from plant.models.builder.importing import ObjectImportError, ObjectsExtraMissingError

    try:
        yield
    except ObjectImportError as error:
        raise InputError(error.message, hint=error.hint, file=mesh) from error
    except ObjectsExtraMissingError as error:
        raise InputError(str(error), hint="pip install 'spot-errand[objects]'") from error


def _unlike_its_class(made: ImportedObject) -> str | None:
    """Returns why the robot may not recognise the object as one of its class, by size; None if the size fits."""
    form = class_forms().get(made.class_name)
    if form is None:
        return None
    _, width, length = sorted(made.size_m)
    for what, value, (low, high) in (("long", length, form.length_m), ("wide", width, form.width_m)):
        if not low <= value <= high:
            expected = f"of class {made.class_name} the robot expects {low:g} to {high:g} m, and may not find it"
            return f"{made.name} is {value:.3f} m {what}; {expected}"
    return None


def _draw(folder: Path, found: ImportedObject, picture: Path) -> None:
    """Draws a model into a PNG file. Raises InputError."""
    import numpy as np

    from plant.scene_pictures import Ball, portrait, save_png

    if picture.suffix.lower() != ".png":
        raise InputError("the picture is written as PNG", hint="name a file that ends in .png", file=picture)
    ball = Ball(np.zeros(3), float(np.linalg.norm(found.size_m)) / 2.0)
    mesh = folder.resolve() / f"{found.name}.obj"
    if not mesh.is_file():
        raise InputError(f"{mesh.name} is missing", hint="import the object once more", file=folder)
    with writing(picture):
        save_png(picture, portrait(mesh, ball, found.size_m, PICTURE_PX))


def _in_words(made: ImportedObject) -> str:
    size, parts = " x ".join(f"{value:.3f}" for value in made.size_m), made.collision_parts
    return f"{made.name}, class {_class_of(made)}, {size} m, {made.mass_kg:g} kg, {count_text(parts, 'collision part')}"


def _class_of(found: ImportedObject) -> str:
    return found.class_name if found.class_name != found.name else "of its own, known by its model"


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{0.0 if abs(value) < 1e-12 else value:.4g}" for value in values)


def _facts(found: ImportedObject, folder: Path) -> dict[str, object]:
    return {"folder": str(folder), **found.model_dump(mode="json", by_alias=True)}
