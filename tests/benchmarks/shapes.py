"""Random boxes, cylinders and blocks, and thin tools, as imported objects of a class that no detector knows."""

from dataclasses import dataclass

import numpy as np
import trimesh

from errand_make.objects import ImportOptions, import_object
from tests.benchmarks.own_objects import made_part
from tests.tables import yaml_beside

KINDS = ("box", "cylinder", "block")
WIDTH_M, LENGTH_M, DENSITY_KG_M3 = (0.02, 0.10), (0.02, 0.30), (300.0, 900.0)
SLENDER, SIDES = 4.0, 32
TOOLS = yaml_beside(__file__, "thin_tools.yaml")


@dataclass(frozen=True)
class Shape:
    """A box or cylinder that stands, or a block that lies: full lengths along x, y and z (m), and its density."""

    kind: str
    size_m: tuple[float, float, float]
    density_kg_m3: float


def random_shape(seed):
    """The shape of a seed: 20 to 100 mm wide and 20 to 300 mm long, none more than four times as high as wide."""
    rng = np.random.default_rng([seed, 11])
    kind, width = KINDS[int(rng.integers(len(KINDS)))], float(rng.uniform(*WIDTH_M))
    other, density = float(rng.uniform(*WIDTH_M)), float(rng.uniform(*DENSITY_KG_M3))
    if kind == "block":
        return Shape(kind, (float(rng.uniform(max(width, other), LENGTH_M[1])), width, other), density)
    across = (width, width if kind == "cylinder" else other)
    high = float(rng.uniform(LENGTH_M[0], min(LENGTH_M[1], SLENDER * min(across))))
    return Shape(kind, (*across, high), density)


def written_shape(seed, folder):
    """Writes the shape of a seed as an imported object into a folder of its own within a folder; returns the former."""
    shape = random_shape(seed)
    x, y, z = shape.size_m
    turns = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    outline = 0.5 * np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
    if shape.kind == "cylinder":
        outline = 0.5 * x * np.column_stack([np.cos(turns), np.sin(turns)])
    area_m2 = 0.5 * float(outline[:, 0] @ np.roll(outline[:, 1], -1) - outline[:, 1] @ np.roll(outline[:, 0], -1))
    low = np.column_stack([outline, np.full(len(outline), -0.5 * z)])
    high, after = low + [0.0, 0.0, z], np.roll(np.arange(len(low)), -1)
    sides = [[[low[k], low[n], high[n]], [low[k], high[n], high[k]]] for k, n in enumerate(after)]
    ends = [[[high[0], high[k], high[k + 1]], [low[0], low[k + 1], low[k]]] for k in range(1, len(low) - 1)]
    corners = np.array(sides + ends).reshape(-1, 3)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in corners]
    lines += [f"f {3 * k + 1} {3 * k + 2} {3 * k + 3}" for k in range(len(corners) // 3)]
    name = f"{shape.kind}_{seed}"
    mesh = folder / f"{name}_mesh.obj"
    mesh.write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / name).mkdir()
    import_object(mesh, ImportOptions(name, round(area_m2 * z * shape.density_kg_m3, 4)), folder / name)
    return folder / name


def tool_mesh(name):
    """The mesh of a thin tool, in mm."""
    return trimesh.util.concatenate([made_part(**part) for part in TOOLS[name]["parts"]])


def written_tool(name, folder):
    """Writes a thin tool as an imported object into a folder of its own within a folder; returns the former."""
    tool, mesh = TOOLS[name], folder / f"{name}_mesh.ply"
    tool_mesh(name).export(mesh)
    (folder / name).mkdir()
    import_object(mesh, ImportOptions(name, tool["mass_kg"], None, 0.001, "z"), folder / name)
    return folder / name
