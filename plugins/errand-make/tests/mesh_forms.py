"""Meshes in the forms that programs write, with the faults that people meet: one body, made anew in each form."""

import io
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from string import Template

import cv2
import numpy as np
import trimesh

SIZE_M = (0.06, 0.08, 0.12)
"""Extents of the body: a box."""


COLLADA = Template(Path(__file__).with_name("box.dae.template").read_text())


def box():
    """The body, with z up, in metres."""
    return trimesh.creation.box(SIZE_M)


def soup(triangles):
    """Mesh of triangles (T, 3, 3) that share no points."""
    corners = np.asarray(triangles, dtype=float).reshape(-1, 3)
    return trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)


def triangles(mesh):
    """Corners (T, 3, 3) of a mesh."""
    return np.array(mesh.triangles, dtype=float)


@dataclass(frozen=True)
class MeshForm:
    """A mesh file: the name, the writer of the file and of what it names, and options of the import.

    Either `refused` is a part of the reason and of its hint, or the body is read: with the volume of the box times
    `share`, and with a `note`, if there is one.
    """

    name: str
    write: object
    options: dict = field(default_factory=dict)
    share: float = 1.0
    note: str | None = None
    refused: str | None = None


def exported(make=box, scale=1.0):
    """Writer of a mesh by trimesh, in other units."""
    return lambda path: make().apply_scale(scale).export(path)


def text(content, **others):
    """Writer of a text file, and of files beside it (`_` in a name stands for a point)."""

    def write(path):
        path.write_text(content)
        for name, other in others.items():
            (path.parent / name.replace("_", ".")).write_bytes(other if isinstance(other, bytes) else other.encode())

    return write


def flipped(which):
    """Maker of the body with some triangles inside out."""

    def make():
        corners = triangles(box())
        corners[which] = corners[which][:, ::-1]
        return soup(corners)

    return make


def joined(*parts):
    """Maker of a body of several pieces of triangles."""
    return lambda: soup(np.vstack([part() for part in parts]))


def whole():
    """Triangles of the body."""
    return triangles(box())


def half(side, *, inside_out=False):
    """Maker of the half of the body at one side of its middle, closed by an own wall."""

    def make():
        corners = triangles(trimesh.creation.box((SIZE_M[0] / 2, *SIZE_M[1:])))
        corners[..., 0] += side * SIZE_M[0] / 4
        return corners[:, ::-1] if inside_out else corners

    return make


def in_3mf(unit="millimeter", scale=1000.0, item=""):
    """Writer of a 3MF file whose body is a component of its only item."""

    def write(path):
        body = box()
        points = "".join('<vertex x="{:.9g}" y="{:.9g}" z="{:.9g}"/>'.format(*p) for p in body.vertices * scale)
        faces = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*face) for face in body.faces)
        said = "" if unit is None else f' unit="{unit}"'
        model = (
            f'<?xml version="1.0"?><model{said} xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
            f'<resources><object id="1" type="model"><mesh><vertices>{points}</vertices><triangles>{faces}</triangles>'
            '</mesh></object><object id="2" type="model"><components><component objectid="1"/></components></object>'
            f'</resources><build><item objectid="2"{item}/></build></model>'
        )
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("3D/3dmodel.model", model)

    return write


def png(colour):
    """Picture of one colour (RGB)."""
    return bytes(cv2.imencode(".png", np.full((4, 4, 3), colour[::-1], np.uint8))[1].tobytes())


def collada(meter=0.01, up="Y_UP", picture="skin.png", *, kind="triangles", node=""):
    """COLLADA file of the body with a picture, as Blender nests the names of samplers, surfaces and images."""
    turn = {"Y_UP": (0, 2, 1), "Z_UP": (0, 1, 2), "X_UP": (2, 1, 0)}[up]
    body = trimesh.creation.box(np.array(SIZE_M)[list(turn)])
    points = " ".join(f"{value / meter:.9g}" for value in body.vertices.flat)
    corners = " ".join(f"{value} 0" for value in body.faces.flat)
    counts = f"<vcount>{' '.join(['3'] * len(body.faces))}</vcount>" if kind == "polylist" else ""
    values = {"numbers": 3 * len(body.vertices), "vertices": len(body.vertices), "faces": len(body.faces)}
    values |= {"points": points, "corners": corners, "counts": counts, "meter": meter, "up": up, "kind": kind}
    return COLLADA.substitute(**values, picture=picture, node=node)


def obj(head="", *, negative=False):
    """OBJ file of the body: quadrilaterals with texture coordinates, by absolute or negative numbers of points."""
    x, y, z = np.array(SIZE_M) / 2
    points = [f"v {i * x:g} {j * y:g} {k * z:g}" for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]
    quads = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]
    shift = -9 if negative else 0
    faces = ["f " + " ".join(f"{n + shift}/{-1 if negative else 1}" for n in quad) for quad in quads]
    return "\n".join(["# made by hand", head, *points, "vt 0.5 0.5", *faces]) + "\n"


def moebius():
    """A strip of paper with a half turn."""
    count = 24
    angle = np.linspace(0.0, 2.0 * np.pi, count + 1)
    edges = [
        np.stack([(1 + s * np.cos(angle / 2)) * np.cos(angle), (1 + s * np.cos(angle / 2)) * np.sin(angle)], axis=1)
        for s in (-0.3, 0.3)
    ]
    low, high = (np.column_stack([e, s * np.sin(angle / 2)]) * 0.05 for e, s in zip(edges, (-0.3, 0.3), strict=True))
    return soup([c for i in range(count) for c in ((low[i], low[i + 1], high[i + 1]), (low[i], high[i + 1], high[i]))])


def with_gaps():
    """The body with corners that differ in the last digits of single precision."""
    return soup(whole() + np.random.default_rng(0).uniform(-4e-7, 4e-7, (12, 3, 3)))


def gltf_without_buffer(path):
    """Writes a glTF file whose buffer is missing."""
    for name, content in trimesh.exchange.gltf.export_gltf(trimesh.Scene(box())).items():
        if name.endswith(".gltf"):
            path.write_bytes(content)


def gltf(path):
    """Writes a glTF file with its buffers, with y up."""
    body = trimesh.creation.box(np.array(SIZE_M)[[0, 2, 1]])
    for name, content in trimesh.exchange.gltf.export_gltf(trimesh.Scene(body)).items():
        (path if name.endswith(".gltf") else path.parent / name).write_bytes(content)


def cut_off(path):
    """Writes the first half of a binary STL file."""
    stream = io.BytesIO()
    box().export(stream, file_type="stl")
    path.write_bytes(stream.getvalue()[:300])


SKIN = "newmtl skin\nKd 0.8 0.8 0.8\nmap_Kd skin.png\n"
FIN = np.array([[(0.03, -0.04, 0.06), (0.03, 0.04, 0.06), (0.05, 0.0, 0.09)]])
FORMS = {
    "binary STL": MeshForm("m.stl", exported()),
    "text STL": MeshForm("m.stl", lambda path: path.write_text(trimesh.exchange.stl.export_stl_ascii(box()))),
    "STL in millimetres": MeshForm("m.stl", exported(scale=1000.0), refused="0.001 if its unit is millimetres"),
    "STL in centimetres": MeshForm("m.stl", exported(scale=100.0), refused="0.01 if its unit is centimetres"),
    "STL in inches": MeshForm("m.stl", exported(scale=1 / 0.0254), options={"scale": 0.0254}),
    "STL in metres that should be divided": MeshForm(
        "m.stl", exported(scale=0.001), refused=r"--scale 1000 \(0.12 m long\), if"
    ),
    "binary PLY": MeshForm("m.ply", exported()),
    "OFF": MeshForm("m.off", exported()),
    "GLB, y up": MeshForm("m.glb", lambda path: trimesh.creation.box(np.array(SIZE_M)[[0, 2, 1]]).export(path)),
    "glTF, y up": MeshForm("m.gltf", gltf),
    "glTF without its buffer": MeshForm("m.gltf", gltf_without_buffer, refused=r"\.bin, which it names, is missing"),
    "OBJ of quadrilaterals": MeshForm("m.obj", text(obj())),
    "OBJ with negative numbers": MeshForm("m.obj", text(obj(negative=True))),
    "OBJ with a picture": MeshForm(
        "m.obj", text(obj("mtllib m.mtl\nusemtl skin"), m_mtl=SKIN, skin_png=png((200, 30, 30)))
    ),
    "OBJ without its MTL": MeshForm("m.obj", text(obj("mtllib m.mtl\nusemtl skin")), note="m.mtl, which it names"),
    "OBJ without its picture": MeshForm(
        "m.obj", text(obj("mtllib m.mtl\nusemtl skin"), m_mtl=SKIN), note="skin.png, which it names, is missing"
    ),
    "OBJ with a picture of another computer": MeshForm(
        "m.obj",
        text(obj("mtllib m.mtl\nusemtl skin"), m_mtl=SKIN.replace("skin.png", "C:\\parts\\skin.png")),
        note="C:",
    ),
    "COLLADA in centimetres, y up": MeshForm("m.dae", text(collada(), skin_png=png((30, 200, 30)))),
    "COLLADA in inches, z up": MeshForm("m.dae", text(collada(0.0254, "Z_UP"), skin_png=png((30, 200, 30)))),
    "COLLADA in millimetres, x up": MeshForm("m.dae", text(collada(0.001, "X_UP"), skin_png=png((30, 200, 30)))),
    "COLLADA without its picture": MeshForm("m.dae", text(collada()), note="skin.png, which it names, is missing"),
    "COLLADA of another program": MeshForm("m.dae", exported(), options={"up": "z"}),
    "3MF in millimetres": MeshForm("m.3mf", in_3mf()),
    "3MF without a unit": MeshForm("m.3mf", in_3mf(None)),
    "3MF in inches": MeshForm("m.3mf", in_3mf("inch", 1 / 0.0254)),
    "3MF with a moved item": MeshForm("m.3mf", in_3mf(item=' transform="1 0 0 0 1 0 0 0 1 900 0 40"')),
    "3MF in furlongs": MeshForm("m.3mf", in_3mf("furlong"), refused="its unit is 'furlong'"),
    "3MF that is none": MeshForm("m.3mf", text("PK"), refused="no 3MF file"),
    "one triangle inside out": MeshForm("m.stl", exported(flipped([3]))),
    "half of it inside out": MeshForm("m.stl", exported(flipped(slice(0, 12, 2)))),
    "all inside out": MeshForm("m.stl", exported(flipped(slice(None)))),
    "all triangles twice": MeshForm("m.stl", exported(joined(whole, whole))),
    "both sides of all triangles": MeshForm("m.stl", exported(joined(whole, lambda: whole()[:, ::-1]))),
    "two bodies with two walls between": MeshForm("m.stl", exported(joined(half(-1), half(1)))),
    "two bodies, one inside out": MeshForm("m.stl", exported(joined(half(-1), half(1, inside_out=True)))),
    "a fin at an edge": MeshForm("m.stl", exported(joined(whole, lambda: FIN))),
    "a body around another": MeshForm(
        "m.stl", exported(joined(whole, lambda: triangles(box().apply_scale(0.5)))), share=0.875
    ),
    "gaps of single precision": MeshForm("m.ply", exported(with_gaps)),
    "open": MeshForm("m.stl", exported(lambda: soup(whole()[2:])), refused="open .* at 4 edges.*--close-holes"),
    "open, with its hole closed": MeshForm(
        "m.ply",
        exported(lambda: soup(whole()[[i for i in range(12) if box().face_normals[i][2] < 0.5]])),
        options={"close_holes": True},
    ),
    "sheet": MeshForm("m.stl", exported(lambda: soup(whole()[[0]])), refused="encloses no volume"),
    "strip with one side": MeshForm("m.stl", exported(moebius), refused="one side only"),
    "pointer of Git LFS": MeshForm(
        "m.glb", text("version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 9\n"), refused="git lfs pull"
    ),
    "web page of an error": MeshForm("m.stl", text("<!DOCTYPE html><html>404</html>"), refused="no mesh|damaged"),
    "cut off": MeshForm("m.stl", cut_off, refused="cut off: 4 of 12 triangles"),
    "empty": MeshForm("m.dae", text(""), refused="empty"),
    "FBX": MeshForm("m.fbx", text("Kaydara FBX Binary"), refused=r"files \*\.fbx are not read; export it as"),
    "STEP": MeshForm("m.step", text("ISO-10303-21;"), refused=r"files \*\.step are not read"),
    "NaN": MeshForm("m.off", text("OFF\n3 1 0\nnan 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), refused="not finite"),
}
