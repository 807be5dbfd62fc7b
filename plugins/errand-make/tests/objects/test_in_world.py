"""An imported object in a world rests where the seed puts it."""

import shutil

import numpy as np
import pytest

from errand_make.objects import ImportOptions, import_object
from executive import load_world
from executive.app.prepare.placed_robots import only_robot
from executive.app.runs.simulated import simulate

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("coacd")

T_SHAPE = np.array([[-0.15, -0.013], [0.12, -0.013], [0.12, -0.05], [0.15, -0.05], [0.15, 0.05], [0.12, 0.05]])
OUTLINE = np.vstack([T_SHAPE, [[0.12, 0.013], [-0.15, 0.013]]])
TRIANGLES = np.array([[0, 1, 6], [0, 6, 7], [1, 2, 3], [1, 3, 4], [1, 4, 6], [4, 5, 6]])
OBJECTS = "objects:\n  - {name: my tool, model: tool, surfaces: [workbench]}\n"


def import_tool(folder, name="tool"):
    """A T of 0.5 kg, 28 mm thick, as a hammer, in a folder with a space in its name."""
    file = folder / "tool.stl"
    trimesh.creation.extrude_triangulation(OUTLINE, TRIANGLES, 0.028).export(file)
    out = folder / f"my {name}"
    out.mkdir()
    import_object(file, ImportOptions(name, 0.5, "hammer"), out)
    return out


@pytest.fixture
def world_folder(tmp_path):
    """The flat with one object, an imported one, and nobody in it."""
    import_tool(tmp_path)
    folder = tmp_path / "flat"
    shutil.copytree(load_world("flat").folder, folder)
    rules = (folder / "objects.yaml").read_text().partition("objects:\n")[0]
    (folder / "objects.yaml").write_text(f"imports: [../my tool]\n{rules}{OBJECTS}")
    return folder


def test_an_imported_object_settles_on_a_table(world_folder):
    world = load_world(str(world_folder))
    simulation = simulate(world, {"Alice": only_robot("Alice", world)}, seed=1, record=False)
    plant = simulation.engine.world.plant
    (index,) = plant.GetBodyIndices(plant.GetModelInstanceByName("my tool"))
    body = plant.get_body(index)
    placed = plant.EvalBodyPoseInWorld(simulation.engine.context, body)
    assert body.default_mass() == pytest.approx(0.5)
    simulation.clock.advance(0.5)
    early = plant.EvalBodyPoseInWorld(simulation.engine.context, body)
    simulation.clock.advance(1.0)
    late = plant.EvalBodyPoseInWorld(simulation.engine.context, body)
    np.testing.assert_allclose(late.translation(), early.translation(), atol=2e-4)
    surface = world.surfaces["workbench"]
    assert late.translation()[2] == pytest.approx(surface.height_m + 0.014, abs=5e-4)
    np.testing.assert_allclose(late.rotation().matrix(), placed.rotation().matrix(), atol=2e-3)
    assert "my tool" in simulation.engine.asleep
