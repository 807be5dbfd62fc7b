from pathlib import Path

from plant.robots.spot.model import simplify_obj

# A square of two triangles with an edge of 1 m, and a sliver of a tenth of a millimetre at its corner.
SOUP = Path(__file__).with_name("soup.obj").read_text()


def rows(kind):
    lines = (line.split() for line in simplify_obj(SOUP, cell_m=0.01).splitlines())
    return [line[1:] for line in lines if line[0] == kind]


def test_vertices_of_one_cell_are_joined_and_faces_share_them():
    first, second = ({int(corner.split("//")[0]) for corner in face} for face in rows("f"))
    assert (len(rows("v")), len(first & second)) == (4, 2)


def test_a_face_whose_corners_merge_vanishes():
    assert len(rows("f")) == 2


def test_normals_stay_with_their_faces():
    normals = rows("vn")
    for face in rows("f"):
        for corner in face:
            assert [float(value) for value in normals[int(corner.split("//")[1]) - 1]] == [0.0, 0.0, 1.0]


def test_material_files_are_not_named():
    assert "mtl" not in simplify_obj(SOUP)
