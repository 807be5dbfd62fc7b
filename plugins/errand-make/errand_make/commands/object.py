"""`errand object` imports a mesh or photographs as a model for worlds and missions, and shows imported models."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from executive import parse
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.cli.number_options import OutOfRangeError, quantity_argument, quantity_option
from executive.cli.options import AS_JSON
from executive.cli.output import console_for, new_folder, print_json, progress_bar
from plant.models.catalogue import ImportedObject, read_imported
from skills.class_forms import class_forms
from skills.inputs.errors import InputError, count_text
from skills.inputs.outside import writing
from skills.quantities import Factor, Mass, TagNumber, TagSize

PICTURE_PX = (640, 480)
_SIDES = re.compile(r"\s*x\s*".join([r"(\d{1,6}(?:\.\d{1,6})?)"] * 3) + r"\s*(mm|cm|m)?")
_UNITS_M = {None: 0.001, "mm": 0.001, "cm": 0.01, "m": 1.0}
_SIDES_M = (0.008, 0.6)
"""Least and greatest side of an object that the robot can recognise."""

object_group = typer.Typer(
    name="object", help="Objects of your own, from any mesh or photographs.", rich_markup_mode=None
)


@object_group.callback()
def _group() -> None:
    """Objects of your own, from any mesh or photographs."""


def _sides_m(text: str) -> tuple[float, ...]:
    """Returns width, depth and height (m) of a text like "80x80x95" (mm) or "8x8x9.5cm". Raises OutOfRangeError."""
    match = _SIDES.fullmatch(text.strip().lower().replace("\N{MULTIPLICATION SIGN}", "x"))
    sides = tuple(round(float(match[k]) * _UNITS_M[match[4]], 6) for k in (1, 2, 3)) if match else (0.0,)
    if not _SIDES_M[0] <= min(sides) <= max(sides) <= _SIDES_M[1]:
        limits = f"from {1e3 * _SIDES_M[0]:g} to {1e3 * _SIDES_M[1]:g} mm each"
        raise OutOfRangeError(f"should be width x depth x height, {limits}; write 80x80x95 for mm, or 8x8x9.5cm")
    return sides


_SIZE = Annotated[
    Any,
    typer.Option(
        parser=_sides_m,
        metavar="WxDxH",
        help="With photographs: width, depth and height as the object stands, 80x80x95 (mm) or 8x8x9.5cm.",
    ),
]


@object_group.command(name="import")
def import_command(
    mesh: Annotated[
        Path,
        typer.Argument(
            metavar="MESH|PHOTOS",
            help="A closed mesh: OBJ, STL, PLY, OFF, glTF, GLB, COLLADA or 3MF; or a folder with 4 to 60 photographs "
            "of one object from all sides, PNG or JPEG, transparent or before a plain background.",
        ),
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
    size: _SIZE = None,
    as_json: AS_JSON = False,
) -> None:
    """Imports an object as a model, from a mesh or from photographs.

    A mesh gives visual geometry, convex collision parts, and inertia from volume and mass. By photographs the robot
    recognises an object that has no mesh; a simulated world cannot place it.
    """
    from errand_make.objects import STEPS, ImportOptions, ImportReports, import_object, import_photographs

    wanted = ImportOptions(name, mass, class_name, scale, up, close_holes)
    with _refused():
        wanted.check()
    _refuse_mixed(mesh, sized=size is not None, for_mesh=wanted != ImportOptions(name, mass))
    out = Path(name) if out is None else out
    notes = list[str]()
    bar = progress_bar(console_for(as_json=True), STEPS[0], len(STEPS))
    with _refused(mesh), new_folder(out) as folder, bar as advance:
        begin = partial(_begin, advance)
        importing = import_object if size is None else partial(import_photographs, size_m=size)
        made = importing(mesh, wanted, folder, ImportReports(begin, notes.append))
    for note in notes:
        typer.echo(f"errand: warning: {mesh}: {note}", err=True)
    if not _can_be_said(made.name):
        typer.echo(f"errand: warning: no sentence can say '{made.name}'; import it under another name", err=True)
    if (doubt := _unlike_its_class(made)) is not None:
        typer.echo(f"errand: warning: {doubt}", err=True)
    if as_json:
        print_json(_facts(made, out))
    else:
        typer.echo(f"{out}: {_in_words(made)}")


def _can_be_said(name: str) -> bool:
    """True when a sentence finds an object of this name in a world that has it."""
    known, said = knowledge_of(open_world("flat")), name.replace("_", " ")
    facts = next(iter(known.things.values())).model_copy(update={"aliases": (said,)})
    known = known.model_copy(update={"things": {**known.things, name: facts}})
    found = [each.object for each in parse(f"find the {said}", knowledge=known).commands]
    return bool(found) and all(each is not None and each.name == name for each in found)


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
    from errand_make.tags import stick_on, tag_svg, write_plate

    if on is not None:
        with _refused(on):
            stick_on(on, number, size, side)
    if out.suffix.lower() == ".svg":
        with writing(out):
            out.write_text(tag_svg(number, size), encoding="utf-8")
    elif out.suffix:
        raise InputError(f"{out} is no SVG file", hint="name a .svg file to print, or a folder for a plate")
    else:
        with new_folder(out) as folder:
            write_plate(folder, number, size)
    carrier = f"on: {read_imported(on).class_name}" if on is not None else "at: [x, y, z], yaw: 0.0"
    typer.echo(f"{out}: for knowledge.yaml, under 'tags': {{id: {number}, size: {size:g}, {carrier}}}")


def _refuse_mixed(mesh: Path, *, sized: bool, for_mesh: bool) -> None:
    """Raises InputError for options that do not fit to a folder of photographs, or to a mesh."""
    if sized != mesh.is_dir():
        what = "it is no folder of photographs" if sized else "photographs show no size"
        hint = "leave --size out for a mesh" if sized else "give it by --size, for example 80x80x95 for mm"
        raise InputError(what, hint=hint, file=mesh)
    if sized and for_mesh:
        raise InputError("--class, --scale, --up and --close-holes are for a mesh", hint="leave them out", file=mesh)


def _begin(advance: Callable[[str], None], step: str) -> None:
    """Ends the step before this one of an import."""
    from errand_make.objects import STEPS

    if step != STEPS[0]:
        advance(step)


@contextmanager
def _refused(mesh: Path | None = None) -> Iterator[None]:
    """Raises InputError for a mesh that cannot be imported."""
    from errand_make.errors import LibraryMissingError, ObjectImportError

    try:
        yield
    except ObjectImportError as error:
        raise InputError(error.message, hint=error.hint, file=mesh) from error
    except LibraryMissingError as error:
        raise InputError(str(error), hint="pip install errand-make") from error


def _unlike_its_class(made: ImportedObject) -> str | None:
    """Returns the reason why an object's size may not fit its class for the detector; None if it fits."""
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

    from errand_make.objects.portrait import Ball, portrait
    from plant.scene_pictures import save_png

    if picture.suffix.lower() != ".png":
        raise InputError("the picture is written as PNG", hint="name a file that ends in .png", file=picture)
    ball = Ball(np.zeros(3), float(np.linalg.norm(found.size_m)) / 2.0)
    mesh = folder.resolve() / f"{found.name}.obj"
    if not mesh.is_file():
        raise InputError(f"{mesh.name} is missing", hint="import the object once more", file=folder)
    with writing(picture):
        save_png(picture, portrait(mesh, ball, found.size_m, PICTURE_PX))


def _in_words(made: ImportedObject) -> str:
    size = " x ".join(f"{value:.3f}" for value in made.size_m)
    parts = count_text(made.photographs or made.collision_parts, "photograph" if made.photographs else "collision part")
    return f"{made.name}, class {_class_of(made)}, {size} m, {made.mass_kg:g} kg, {parts}"


def _class_of(found: ImportedObject) -> str:
    return found.class_name if found.class_name != found.name else "of its own, known by its model"


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{0.0 if abs(value) < 1e-12 else value:.4g}" for value in values)


def _facts(found: ImportedObject, folder: Path) -> dict[str, object]:
    return {"folder": str(folder), **found.model_dump(mode="json", by_alias=True)}
