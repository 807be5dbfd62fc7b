from plant.models.spot.looks import slim_obj

SOUP = """mtllib material.mtl
usemtl material_0
v 0 0 0
v 1 0 0
v 0 1 0
v 1 0 0
v 1 1 0
v 0 1 0.00001
vn 0 0 1
vt 0 0
f 1/1/1 2/1/1 3/1/1
f 4/1/1 5/1/1 6/1/1
"""


def test_repeated_vertices_are_kept_once_and_faces_follow():
    lines = slim_obj(SOUP).splitlines()
    vertices = [line for line in lines if line.startswith("v ")]
    faces = [line for line in lines if line.startswith("f ")]
    assert len(vertices) == 4
    corners = [{int(corner.split("//")[0]) for corner in face.split()[1:]} for face in faces]
    assert len(corners[0] & corners[1]) == 2


def test_material_files_are_not_named():
    assert "mtl" not in slim_obj(SOUP)
