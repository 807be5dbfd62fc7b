"""The scenery of a world: the shapes of fixed models, registered on the world body itself.

A link that is welded to the world is still a body for Drake, and costs time in every step. So the directives are read
into a temporary plant, and the shapes of its welded models are registered on the world body. A model with a moving part
stays a model.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

from pydrake.geometry import (
    GeometryId,
    GeometryInstance,
    PerceptionProperties,
    ProximityProperties,
    SceneGraphInspector,
)
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import (
    FlattenModelDirectives,
    GetScopedFrameByName,
    LoadModelDirectives,
    ModelDirective,
    ModelDirectives,
    Parser,
    ProcessModelDirectives,
)
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import BodyIndex, ModelInstanceIndex
from pydrake.systems.framework import DiagramBuilder

from plant.worlds.geometry_files import OWN_PACKAGE
from skills.files.errors import InputError

_RELATIVE_URI = re.compile(r"<uri>\s*(?![a-z]+://)([^<\s]+)\s*</uri>")


def add_scenery(
    plant: MultibodyPlant, directives: Path, parser_of: Callable[[MultibodyPlant], Parser]
) -> dict[GeometryId, str]:
    """Adds the directives' world to `plant` (before Finalize); returns the model name of each collision shape.

    Raises:
        InputError: Drake cannot use the directives or a model.
    """

    def parser_in(into: MultibodyPlant) -> Parser:
        parser = parser_of(into)
        parser.package_map().Add(OWN_PACKAGE, directives.parent)
        return parser

    scratch, scene_graph = AddMultibodyPlant(MultibodyPlantConfig(), DiagramBuilder())
    parser = parser_in(scratch)
    try:
        flat = FlattenModelDirectives(LoadModelDirectives(directives), parser.package_map()).directives
        _process(flat, scratch, parser)
        scratch.Finalize()
        moving = _moving_models(scratch, flat)
        _process([each for each in flat if _models_of(each) <= moving], plant, parser_in(plant))
    except (RuntimeError, ValueError) as error:
        raise _refused(directives, error) from error
    return _copy_fixed(scratch, scene_graph.model_inspector(), moving, plant)


def add_model(parser: Parser, path: Path) -> ModelInstanceIndex:
    """Adds the model of a file. SDF is parsed from text, because the parser takes 50 ms for each file that it opens.

    Raises:
        InputError: Drake cannot use the file.
    """
    if path.suffix == ".sdf":
        text = path.read_text(encoding="utf-8")
        try:
            return _only(
                parser.AddModelsFromString(_RELATIVE_URI.sub(rf"<uri>{path.parent.as_uri()}/\1</uri>", text), "sdf")
            )
        except RuntimeError:
            pass  # parses the file again, for a message that names it
    try:
        return _only(parser.AddModels(str(path)))
    except (RuntimeError, ValueError) as error:
        raise _refused(path, error) from error


def _refused(file: Path, error: Exception) -> InputError:
    """Error with Drake's message about a file, in one line."""
    reason = " ".join(str(error).split()) or type(error).__name__
    return InputError(f"the simulation cannot use it: {reason[:300]}", hint="correct the file", file=file)


def _only(instances: Sequence[ModelInstanceIndex]) -> ModelInstanceIndex:
    (instance,) = instances
    return instance


def _process(directives: Sequence[ModelDirective], plant: MultibodyPlant, parser: Parser) -> None:
    """Carries out directives one by one."""
    for each in directives:
        model, weld = each.add_model, each.add_weld
        if model is not None and not (model.default_joint_positions or model.default_free_body_pose):
            path = Path(parser.package_map().ResolveUrl(model.file))
            plant.RenameModelInstance(add_model(parser, path), model.name)
        elif weld is not None:
            X_PC = RigidTransform() if weld.X_PC is None else weld.X_PC.GetDeterministicValue()
            parent, child = (GetScopedFrameByName(plant, name) for name in (weld.parent, weld.child))
            plant.WeldFrames(parent, child, X_PC)
        else:
            ProcessModelDirectives(ModelDirectives(directives=[each]), parser)


def _copy_fixed(
    scratch: MultibodyPlant, inspector: SceneGraphInspector, moving: set[str], plant: MultibodyPlant
) -> dict[GeometryId, str]:
    """Registers the shapes of all fixed models on the world body of `plant`; returns their models."""
    context, world, pieces = scratch.CreateDefaultContext(), plant.world_body(), {}
    for geometry in inspector.GetAllGeometryIds():
        body = scratch.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        model = _model_of(scratch, body.index())
        if model in moving:
            continue
        X_WG = scratch.EvalBodyPoseInWorld(context, body) @ inspector.GetPoseInFrame(geometry)
        shape, name = inspector.GetShape(geometry), inspector.GetName(geometry)
        proximity = inspector.GetProximityProperties(geometry)
        if proximity is not None:
            copy = plant.RegisterCollisionGeometry(world, X_WG, shape, name, ProximityProperties(proximity))
            pieces[copy] = model
        else:
            visual = GeometryInstance(X_WG, shape, name)
            _copy_appearance(inspector, geometry, visual)
            plant.RegisterVisualGeometry(world, visual)
    return pieces


def _copy_appearance(inspector: SceneGraphInspector, geometry: GeometryId, visual: GeometryInstance) -> None:
    """Copies the appearance of a shape, without the label, which names a body of the temporary plant."""
    illustration = inspector.GetIllustrationProperties(geometry)
    if illustration is not None:
        visual.set_illustration_properties(illustration)
    perception = inspector.GetPerceptionProperties(geometry)
    if perception is not None:
        unlabelled = PerceptionProperties(perception)
        unlabelled.RemoveProperty("label", "id")
        visual.set_perception_properties(unlabelled)


def _moving_models(scratch: MultibodyPlant, directives: Sequence[ModelDirective]) -> set[str]:
    """Names of the models with a part that is not fixed to the world, and of models welded to them."""
    bodies = (BodyIndex(index) for index in range(scratch.num_bodies()))
    moving = {_model_of(scratch, index) for index in bodies if not scratch.IsAnchored(scratch.get_body(index))}
    for each in reversed(directives):
        if each.add_weld is not None and _scope(each.add_weld.child) in moving:
            moving |= _models_of(each)
    return moving


def _models_of(directive: ModelDirective) -> set[str]:
    """Names of the models that a directive refers to."""
    if directive.add_model is not None:
        return {directive.add_model.name}
    if directive.add_weld is not None:
        scopes = {_scope(directive.add_weld.parent), _scope(directive.add_weld.child)}
    elif directive.add_frame is not None:
        scopes = {_scope(directive.add_frame.X_PF.base_frame or "")}
    elif directive.add_collision_filter_group is not None:
        scopes = {_scope(member) for member in directive.add_collision_filter_group.members}
    else:
        scopes = set()
    return scopes - {""}


def _scope(name: str) -> str:
    """Model of a scoped name such as `table::leg`; empty for a name of the world."""
    return name.partition("::")[0] if "::" in name else ""


def _model_of(plant: MultibodyPlant, body: BodyIndex) -> str:
    """Name of the model in the directives that a body belongs to."""
    instance = plant.get_body(body).model_instance()
    return str(plant.GetModelInstanceName(instance)).partition("::")[0]
