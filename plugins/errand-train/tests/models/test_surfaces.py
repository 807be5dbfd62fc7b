"""Surfaces: closed, outward, and of the volume of the book."""

import json

import numpy as np
import pytest

from errand_make.mesh import Material, Mesh
from errand_make.shapes import solid_mass
from errand_train.models.gltf import gltf_text
from errand_train.models.mass import join_masses
from errand_train.models.outlines import area, inset, triangles_of
from errand_train.models.surfaces import add_ellipsoid, add_extruded, add_ring, add_rounded_box, add_tube

MATERIALS = {"red": Material((1.0, 0.0, 0.0)), "label": Material(texture="label.png")}
L_SHAPE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]


def mesh():
    return Mesh(MATERIALS)


def test_an_ellipsoid_weighs_what_it_should():
    body = mesh()
    add_ellipsoid(body, "red", (1, 2, 3), (0.1, 0.2, 0.3), sides=40)
    mass = solid_mass(body, 1000.0)
    assert mass.mass_kg == pytest.approx(4 / 3 * np.pi * 6.0, rel=0.02)
    np.testing.assert_allclose(mass.com, (1, 2, 3), atol=1e-6)


def test_a_tube_and_a_ring_are_closed_and_look_outward():
    tube, ring = mesh(), mesh()
    add_tube(tube, "red", [(0, 0, 0), (0, 0, 1), (0, 0, 2)], [0.1, 0.1, 0.1], sides=40)
    add_ring(ring, "red", 0.1, 0.2, 0.0, 0.1)
    assert solid_mass(tube, 1.0).mass_kg == pytest.approx(np.pi * 0.02, rel=0.02)
    assert solid_mass(ring, 1.0).mass_kg == pytest.approx(np.pi * 0.03 * 0.1, rel=0.02)


@pytest.mark.parametrize("outline", [L_SHAPE, L_SHAPE[::-1]])
def test_a_hollow_outline_is_filled_whichever_way_it_runs(outline):
    body = mesh()
    add_extruded(body, "red", outline, 0.0, 1.0)
    assert solid_mass(body, 1.0).mass_kg == pytest.approx(3.0)


def test_triangles_of_an_outline_cover_its_area_without_overlap():
    points = np.array(L_SHAPE, dtype=float)
    assert sum(area(points[list(t)]) for t in triangles_of(points)) == pytest.approx(area(points))
    assert all(area(points[list(t)]) >= 0 for t in triangles_of(points))


def test_an_inset_moves_every_edge_inward_by_the_distance():
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    assert area(inset(square, 0.1)) == pytest.approx(0.64)


def test_a_rounded_box_is_a_little_lighter_than_the_box():
    body = mesh()
    add_rounded_box(body, "red", (0, 0, 0), (1, 2, 3), 0.05)
    mass = solid_mass(body, 1.0)
    assert 5.95 < mass.mass_kg < 6.0
    np.testing.assert_allclose(mass.com, (0.5, 1.0, 1.5), atol=1e-6)


def test_two_bodies_together_obey_the_parallel_axes():
    parts = []
    for x in (-1.0, 1.0):
        part = mesh()
        part.add_box("red", (x - 0.1, -0.1, -0.1), (x + 0.1, 0.1, 0.1))
        parts.append(solid_mass(part, 125.0))
    whole = join_masses(parts)
    assert whole.mass_kg == pytest.approx(2.0)
    np.testing.assert_allclose(whole.com, 0.0, atol=1e-12)
    own = 0.04 / 6
    np.testing.assert_allclose(np.diag(whole.inertia), (2 * own, 2 * own + 2.0, 2 * own + 2.0), rtol=1e-9)


def test_an_empty_or_inverted_mesh_has_no_mass():
    body = mesh()
    body.add_rectangle("red", (0, 0, 1), (0, 1, 0), (1, 0, 0))
    with pytest.raises(ValueError, match="empty, open or inside out"):
        solid_mass(body, 1.0)


def test_gltf_names_its_pictures_and_holds_every_triangle():
    body = mesh()
    body.add_box("red", (0, 0, 0), (1, 1, 1))
    body.add_rectangle("label", (0, 0, 2), (1, 0, 0), (0, 1, 0))
    file = json.loads(gltf_text(body))
    assert [image["uri"] for image in file["images"]] == ["label.png"]
    indices = [file["accessors"][p["indices"]]["count"] for p in file["meshes"][0]["primitives"]]
    assert sum(indices) == 3 * (12 + 2)
