"""Boxes of the tests' worlds: as models that stand still, and as directives."""

from pydrake.math import RigidTransform

from plant.diagram import LooseModel


def box_file(folder, name, size, place="0 0 0"):
    """Writes a model of one box; returns its file."""
    shape = f"<pose>{place} 0 0 0</pose><geometry><box><size>{size}</size></box></geometry>"
    link = f'<link name="{name}"><collision name="{name}">{shape}</collision></link>'
    file = folder / f"{name}.sdf"
    file.write_text(f'<sdf version="1.9"><model name="{name}">{link}</model></sdf>')
    return file


def fixed_box(folder, name, size, place="0 0 0"):
    return LooseModel(name, box_file(folder, name, size, place), RigidTransform(), fixed=True)


def box_world(folder, **boxes):
    """Writes directives of boxes, by their size and place, that belong to the world; returns their file."""
    text = "directives:\n"
    for name, (size, place) in boxes.items():
        text += f'- add_model: {{name: {name}, file: "{box_file(folder, name, size, place).as_uri()}"}}\n'
        text += f'- add_weld: {{parent: world, child: "{name}::{name}"}}\n'
    (folder / "world.dmd.yaml").write_text(text)
    return folder / "world.dmd.yaml"
