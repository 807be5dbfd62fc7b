"""Meshes of a robot: their role decides how they are read; sizes, gaps and missing files are named."""

import cart_urdf as cart
import numpy as np
import pytest
import trimesh
from rover_urdf import joint

from errand_make.objects.mesh_files import MeshContent, Patch
from errand_make.robots.meshes import coarser
from errand_make.robots.package import render_robot
from skills.inputs.errors import InputError


@pytest.fixture
def render(tmp_path):
    """Renders the cart with a hood of a mesh in some roles; returns the notes."""

    def rendered(mesh, *roles, name="hood.stl", scale=""):
        mesh.export(tmp_path / name)
        shape = f'<geometry><mesh filename="{name}"{scale}/></geometry>'
        hood = f'<link name="hood">{"".join(f"<{role}>{shape}</{role}>" for role in roles)}</link>'
        urdf = tmp_path / "cart.urdf"
        urdf.write_text(cart.robot(cart.base(), cart.wheels(), hood, joint("hood_mount", "fixed", "base_link", "hood")))
        return "\n".join(render_robot("cart", urdf, tmp_path / "made", packages={}))

    return rendered


def written(tmp_path):
    """Text of the first mesh of the package."""
    return next((tmp_path / "made").rglob("*.obj")).read_text()


def test_a_visual_mesh_named_collision_is_an_appearance(render, tmp_path):
    render(trimesh.creation.box((0.2, 0.2, 0.1)), "visual", name="hood_collision_x.stl")
    assert "\nvn " in written(tmp_path) and "usemtl" in written(tmp_path)


def test_a_collision_mesh_named_visual_is_a_hull(render, tmp_path):
    render(trimesh.creation.box((0.2, 0.2, 0.1)), "collision", name="hood_visual_x.stl")
    assert written(tmp_path).count("\nf ") == 12 and "vn " not in written(tmp_path)


def test_a_sticker_of_two_triangles_has_a_hull(render, tmp_path):
    corners = [[0, 0, 0.3], [0.05, 0, 0.3], [0.05, 0.05, 0.3], [0, 0.05, 0.3]]
    render(trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False), "visual", "collision")
    hull = next(path for path in (tmp_path / "made").rglob("*.obj") if "collision" in path.name).read_text()
    heights = {float(line.split()[3]) for line in hull.splitlines() if line.startswith("v ")}
    assert max(heights) - min(heights) == pytest.approx(0.001, abs=1e-4)


@pytest.mark.parametrize("scale", ["", ' scale="1 1 1"'])
def test_a_mesh_in_millimetres_without_a_scale_is_refused_with_its_line(render, scale):
    with pytest.raises(InputError, match=r"hood.stl is 300 m long.*millimetre") as refused:
        render(trimesh.creation.box((300, 200, 100)), "visual", scale=scale)
    assert refused.value.line and 'scale="0.001 0.001 0.001"' in refused.value.hint


def test_a_mesh_in_millimetres_with_its_scale_is_taken(render):
    assert "meshes:" not in render(
        trimesh.creation.box((300, 200, 100)), "collision", scale=' scale="0.001 0.001 0.001"'
    )


def test_two_bodies_far_apart_in_one_collision_mesh_are_noted(render):
    pair = [trimesh.creation.box((0.1, 0.1, 0.1)), trimesh.creation.box((0.1, 0.1, 0.1))]
    pair[1].apply_translation((0.4, 0.0, 0.0))
    assert "two bodies of this collision mesh are 0.30 m apart" in render(trimesh.util.concatenate(pair), "collision")


def test_a_missing_mesh_is_named_with_the_file_that_is_there(tmp_path):
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "hood.stl")
    hood = '<link name="hood"><visual><geometry><mesh filename="hood.dae"/></geometry></visual></link>'
    urdf = tmp_path / "cart.urdf"
    urdf.write_text(cart.robot(cart.base(), cart.wheels(), hood, joint("hood_mount", "fixed", "base_link", "hood")))
    with pytest.raises(InputError, match=r"there is no mesh .*hood.dae") as refused:
        render_robot("cart", urdf, tmp_path / "made", packages={})
    assert "write the name of hood.stl" in refused.value.hint


def test_a_finer_mesh_becomes_coarser_and_keeps_its_size():
    ball = trimesh.creation.icosphere(6)
    patch = Patch(ball.triangles, np.zeros((len(ball.faces), 3, 2)))
    fewer = coarser(MeshContent((patch,)), 20_000)
    count = sum(len(each.triangles) for each in fewer)
    assert 5_000 < count <= 20_000
    assert np.allclose(np.ptp(fewer[0].triangles.reshape(-1, 3), axis=0), 2.0, atol=0.05)
