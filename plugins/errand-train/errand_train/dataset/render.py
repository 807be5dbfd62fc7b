"""Rendering of a scene from several views, with labels."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.geometry import (
    Box,
    FrameId,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    MakeRenderEngineVtk,
    PerceptionProperties,
    QueryObject,
    RenderLabel,
    Rgba,
    SceneGraph,
    Shape,
)
from pydrake.geometry import Mesh as MeshShape
from pydrake.math import RigidTransform, RollPitchYaw

from errand_make.mesh import Mesh, mtl_text, obj_text, palette_picture
from errand_train.dataset.coco import annotation, is_black
from errand_train.dataset.compose import SELDOM_BY_CHANCE, Held, Placed, Scene, compose
from errand_train.dataset.degrade import Degradation, degrade
from errand_train.dataset.hand import hand_mesh
from errand_train.dataset.lighting import Lighting, random_lighting
from errand_train.dataset.objects import ObjectModel
from errand_train.dataset.room import Room, texture_file
from errand_train.dataset.silhouette import silhouette
from errand_train.dataset.textures import texture
from errand_train.dataset.views import View, any_view, camera_specs, roll_deg, view_of
from errand_train.models.gltf import gltf_text
from plant.scene_pictures import png_bytes
from plant.sensors.camera_spec import NEAR_M, colour_render_camera
from skills.robot import Picture

TRAINING_VIEWS: Final = 24
VALIDATION_VIEWS: Final = 8
VALIDATION_EVERY: Final = 6
_BACKGROUND: Final = 32000
_RENDERER: Final = "vtk"
_FAR_AWAY: Final = RigidTransform([0.0, 0.0, -200.0])


@dataclass(frozen=True)
class Shot:
    """One picture, (H, W, 3) RGB or (H, W) grey, with its JPEG quality, metadata and labels."""

    picture: Picture
    quality: int
    facts: dict[str, Any]
    labels: list[dict[str, Any]]


def is_validation(index: int) -> bool:
    """Returns whether the scene of a number uses held-out instances, layouts and textures."""
    return index % VALIDATION_EVERY == VALIDATION_EVERY - 1


def views_in(index: int) -> int:
    """Number of pictures of a scene."""
    return VALIDATION_VIEWS if is_validation(index) else TRAINING_VIEWS


def render_scene(seed: int, index: int, others: Sequence[ObjectModel] = ()) -> list[Shot]:
    """Renders the pictures of a scene, equal for equal arguments; `others` replace some of its distractors."""
    rng = np.random.default_rng([seed, index, 71])
    scene = compose(rng, index, for_training=not is_validation(index), others=others)
    lighting = random_lighting(rng, scene.room)
    with tempfile.TemporaryDirectory(prefix="errand-scene-") as folder:
        stage = Stage(scene, lighting, Path(folder), float(rng.uniform(0.8, 1.57)))
        views = _views(rng, scene, views_in(index), others)
        return [_shot(rng, stage, view, scene, lighting, index, number) for number, view in enumerate(views)]


def _views(rng: np.random.Generator, scene: Scene, count: int, others: Sequence[ObjectModel]) -> list[View]:
    """Chooses views: the objects of the classes take turns; without any, the distractors do.

    A quarter of the views show the `others` in the scene.
    """
    specs = camera_specs()
    objects = [item for item in scene.objects if item.model.class_id] or list(scene.objects)
    turns = [item for item in objects for _ in range(2 if item.model.category in SELDOM_BY_CHANCE else 1)]
    strange = [item for item in scene.objects if item.model in others]
    if strange and objects:
        turns += [strange[int(k)] for k in rng.integers(len(strange), size=len(turns) // 3)]
    order = [turns[k] for k in rng.permutation(len(turns))]
    views: list[View] = []
    for attempt in range(3 * count):
        if len(views) == count or not order:
            break
        view = view_of(rng, scene.room, order[attempt % len(order)], specs)
        if view is not None:
            views.append(view)
    views += [any_view(rng, scene.room, specs) for _ in range(count - len(views))]
    by_hand = [k for k, view in enumerate(views) if view.camera == "hand"]
    shown = by_hand[: count // 4 if scene.held else count // 8 * int(rng.random() < 0.5)]
    return [replace(view, in_hand=True) if k in shown else view for k, view in enumerate(views)]


class Stage:
    """The scene in Drake, rendered from any view."""

    def __init__(self, scene: Scene, lighting: Lighting, folder: Path, opening_rad: float) -> None:
        self._graph, self._physical = SceneGraph(), lighting.physical
        self._graph.AddRenderer(_RENDERER, MakeRenderEngineVtk(lighting.parameters))
        self._source = self._graph.RegisterSource("scene")
        self._hand = self._graph.RegisterFrame(self._source, GeometryFrame("hand"))
        self._world = self._graph.world_frame_id()
        self.labelled: dict[int, tuple[ObjectModel, RigidTransform, bool]] = {}
        self._add(
            self._world, _mesh_file(folder, "room", scene.room.mesh, scene.room, self._physical), RigidTransform()
        )
        for item in scene.objects:
            self._add_object(self._world, item.model, item.X_WO, in_hand=False)
        self._add_seats(scene)
        opening = _jaw_for(scene.held) if scene.held else opening_rad
        self._add(self._hand, _mesh_file(folder, "hand", hand_mesh(opening), None, self._physical), RigidTransform())
        if scene.held:
            self._add_object(self._hand, scene.held.model, scene.held.X_HO, in_hand=True)
        self._context = self._graph.CreateDefaultContext()
        self._X_HC = camera_specs()["hand"].X_link_camera()

    def _add_object(self, frame: FrameId, model: ObjectModel, X_FO: RigidTransform, *, in_hand: bool) -> None:
        label = _BACKGROUND
        if model.class_id:
            label = len(self.labelled) + 1
            self.labelled[label] = (model, X_FO, in_hand)
        self._add(frame, MeshShape(str(model.gltf_path if self._physical else model.obj_path)), X_FO, label)

    def _add_seats(self, scene: Scene) -> None:
        for x, y, yaw, height in scene.seats:
            X_WS = RigidTransform(
                RollPitchYaw(0.0, 0.0, yaw), [x - 0.08 * np.cos(yaw), y - 0.08 * np.sin(yaw), height / 2]
            )
            self._add(self._world, Box(0.34, 0.40, height), X_WS, colour=Rgba(0.35, 0.30, 0.26, 1.0))

    def _add(
        self, frame: FrameId, shape: Shape, X_FG: RigidTransform, label: int = _BACKGROUND, colour: Rgba | None = None
    ) -> None:
        appearance = GeometryInstance(X_FG, shape, f"g{self._graph.model_inspector().num_geometries()}")
        properties = PerceptionProperties()
        properties.AddProperty("label", "id", RenderLabel(label))
        if colour is not None:
            properties.AddProperty("phong", "diffuse", colour)
        appearance.set_perception_properties(properties)
        self._graph.RegisterGeometry(self._source, frame, appearance)

    def hand_pose(self, view: View) -> RigidTransform:
        """Pose of the hand: about the camera when in view, else far away."""
        return view.X_WC @ self._X_HC.inverse() if view.in_hand else _FAR_AWAY

    def take(self, view: View) -> tuple[Picture, NDArray[np.int16]]:
        """Renders the clean picture (H, W, 3) and the labels (H, W)."""
        poses = FramePoseVector()
        poses.set_value(self._hand, self.hand_pose(view))
        self._graph.get_source_pose_port(self._source).FixValue(self._context, Value(poses))
        query = self._graph.get_query_output_port().Eval(self._context)
        assert isinstance(query, QueryObject)
        camera = colour_render_camera(view.intrinsics, _RENDERER)
        colour = query.RenderColorImage(camera, self._world, view.X_WC)
        labels = query.RenderLabelImage(camera, self._world, view.X_WC)
        return np.ascontiguousarray(colour.data[..., :3]), np.array(labels.data[..., 0], dtype=np.int16)


def _jaw_for(held: Held) -> float:
    """Angle at which the finger nearly touches the object."""
    thick = float(np.sort(held.model.size_m)[0])
    return float(np.clip(thick / 0.10, 0.05, 1.2))


def _mesh_file(folder: Path, name: str, mesh: Mesh, room: Room | None, physical: bool) -> MeshShape:
    """Writes a mesh for this scene only."""
    shown = {mesh.materials[material].texture for material, *_ in mesh.groups()}
    for role, number in room.textures if room else ():
        if texture_file(role, number) in shown:
            (folder / texture_file(role, number)).write_bytes(_texture_bytes(role, number))
    path = folder / f"{name}.{'gltf' if physical else 'obj'}"
    if physical:
        path.write_text(gltf_text(mesh), encoding="utf-8")
        return MeshShape(str(path))
    path.write_text(obj_text(mesh, f"{name}.mtl"), encoding="utf-8")
    (folder / f"{name}.mtl").write_text(mtl_text(mesh, f"{name}_palette.png"), encoding="utf-8")
    (folder / f"{name}_palette.png").write_bytes(png_bytes(palette_picture(mesh.materials)))
    return MeshShape(str(path))


@lru_cache(maxsize=256)
def _texture_bytes(role: str, number: int) -> bytes:
    return png_bytes(texture(role, number))


def _shot(
    rng: np.random.Generator, stage: Stage, view: View, scene: Scene, lighting: Lighting, index: int, number: int
) -> Shot:
    clean, labels = stage.take(view)
    how = Degradation.draw(rng)
    picture = degrade(clean, how, rng, grey=view.grey)
    facts = {
        "width": view.intrinsics.width,
        "height": view.intrinsics.height,
        "camera": view.camera,
        "grey": view.grey,
        "roll_deg": round(roll_deg(view.X_WC), 1),
        "intrinsics": _rounded(view),
        "scene": index,
        "view": number,
        "split": "val" if is_validation(index) else "train",
        "style": lighting.style,
        "crowded": scene.crowded,
        "motion_px": round(how.motion_px, 1),
    }
    return Shot(picture, how.quality, facts, label_view(stage.labelled, labels, view, stage.hand_pose(view), picture))


def _rounded(view: View) -> list[float]:
    k = view.intrinsics
    return [round(value, 2) for value in (k.fx, k.fy, k.cx, k.cy)]


def label_view(
    labelled: Mapping[int, tuple[ObjectModel, RigidTransform, bool]],
    labels: NDArray[np.int16],
    view: View,
    X_WH: RigidTransform,
    picture: Picture,
) -> list[dict[str, Any]]:
    """Labels the visible objects of the classes: masks from the label image, visibility from silhouettes."""
    found, X_CW = [], view.X_WC.inverse()
    for label in sorted(set(np.unique(labels).tolist()) & set(labelled)):
        model, X_FO, in_hand = labelled[label]
        X_CO = X_CW @ X_WH @ X_FO if in_hand else X_CW @ X_FO
        points_C = np.asarray(X_CO @ model.surface.points.T).T
        alone = silhouette(points_C, model.surface.faces, view.intrinsics)
        distance = float(np.linalg.norm(points_C.mean(axis=0)))
        mask = labels == label
        entry = annotation(
            mask=mask,
            alone=alone,
            class_id=model.class_id,
            instance=model.name,
            distance_m=distance,
            unseeable=is_black(picture, mask) or _opened_by_camera(points_C),
        )
        if entry is not None:
            found.append(entry)
    return found


def _opened_by_camera(points_C: NDArray[np.float64]) -> bool:
    """Returns whether the camera, or its near plane, is within the box of an object's points (N, 3).

    Then the picture shows what is behind the object, and the label image its inside.
    """
    return bool(np.all(points_C.min(axis=0) < (0.0, 0.0, NEAR_M)) and np.all(points_C.max(axis=0) > 0.0))


__all__ = ["Placed", "Shot", "is_validation", "label_view", "render_scene", "views_in"]
