"""Builds the Drake Diagram of a world with its robots, people and loose objects."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
from pydrake.geometry import (
    Box,
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    HalfSpace,
    Meshcat,
    MeshcatVisualizer,
    ProximityProperties,
    RenderEngineVtkParams,
    RoleAssign,
    SceneGraph,
)
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import BodyIndex, FixedOffsetFrame, Frame, ModelInstanceIndex, PlanarJoint, RigidBody
from pydrake.systems.framework import Diagram, DiagramBuilder

from plant.events import add_panel
from plant.rendering import Scene
from plant.robots.robot_kind import BodyOptions, LocomotionLimits, RobotBody, robot_kind
from plant.scenery import add_model, add_scenery
from plant.worlds.world import DoorRule, add_package

TIME_STEP_S = 0.0125
NEAR_RIGID = 0.1
"""Contact of light objects is as soft as this times a time step's (Castro et al. 2022, section V.B); Drake's 1.0 lets
80 N press a fingertip 3 cm into a cube of 50 g."""
FLOOR_TOP_M = 0.01
TRAY_PATH = Path(__file__).parent / "models" / "tray" / "tray.sdf"
X_PT_HOME = RigidTransform(
    RotationMatrix(np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])), np.array([0.0, 0.0, 1.08])
)
"""Where a person P keeps a tray T that is not in use: upright within the torso, the handle up."""


@dataclass(frozen=True)
class LooseModel:
    """A model put into the world at the beginning: X_WM is the pose of its base.

    A fixed one is welded there. One that `slides` moves upright in x, y and yaw, as somebody moves it, and touches
    nothing that is fixed. A person who `receives` has a tray.
    """

    name: str
    path: Path
    X_WM: RigidTransform
    fixed: bool = False
    slides: bool = False
    receives: bool = False


@dataclass(frozen=True)
class WorldDiagram:
    """The finished Diagram and handles to its parts.

    `trays` are those of people who receive, by the people's names, and are none of `models`. `scenery` names the model
    that each collision shape of the world body comes from. `scene` renders it, where that
    was wanted; `rebuild` makes the same once more, shown in a Meshcat.
    """

    diagram: Diagram
    plant: MultibodyPlant
    scene_graph: SceneGraph
    robots: Mapping[str, RobotBody]
    models: Mapping[str, ModelInstanceIndex]
    trays: Mapping[str, RigidBody]
    scenery: Mapping[GeometryId, str]
    scene: Scene | None
    rebuild: Callable[[Meshcat], WorldDiagram]


def build_diagram(
    *,
    directives: Path | None,
    models: Sequence[LooseModel],
    robots: Mapping[str, str],
    doors: Sequence[DoorRule] = (),
    visuals: bool = True,
    carried: bool = True,
    locomotion: Mapping[str, LocomotionLimits] = MappingProxyType({}),
    render: bool = True,
    renderer_parameters: RenderEngineVtkParams | None = None,
    meshcat: Meshcat | None = None,
    friction: float = 1.0,
) -> WorldDiagram:
    """A Diagram of the directives' world (or an empty one) with models and robots.

    SAP contact at `TIME_STEP_S`; sampled outputs, which would double the cost of a step, are off, so that evaluating
    contact results solves once more. Positions of the models are defaults, the robots' are set by the caller.
    `robots` names the kind of each; `doors` have panels, which are models, too.
    `renderer_parameters` set light and sky; `meshcat` shows the world there.
    `visuals` draws robots with meshes where they are installed; `render` makes the scene for cameras; `locomotion`
    limits what bears each robot. `friction` multiplies the coefficients of all that moves.
    """
    rebuild = partial(
        build_diagram,
        directives=directives,
        models=models,
        robots=robots,
        doors=doors,
        visuals=visuals,
        carried=carried,
        locomotion=locomotion,
        render=False,
    )
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(
        time_step=TIME_STEP_S, discrete_contact_approximation="sap", use_sampled_output_ports=False
    )
    plant, scene_graph = AddMultibodyPlant(config, builder)
    plant.set_sap_near_rigid_threshold(NEAR_RIGID)
    parser = parser_of(plant)
    scenery = {} if directives is None else add_scenery(plant, directives, parser_of)
    instances = {model.name: _add_model(plant, parser, model) for model in models}
    panels = {door.name: add_panel(plant, door) for door in doors}
    trays = {model.name: _add_tray(plant, parser, model) for model in models if model.receives}
    bodies = {
        name: robot_kind(kind).add(plant, name, BodyOptions(visuals, carried, locomotion.get(name)))
        for name, kind in sorted(robots.items())
    }
    plant.Finalize()
    if friction != 1.0:
        multiply_friction(plant, scene_graph, friction)
    for model in models:
        if not (model.fixed or model.slides):
            (body,) = plant.GetBodyIndices(instances[model.name])[:1]
            plant.SetDefaultFloatingBaseBodyPose(plant.get_body(body), model.X_WM)
    filters = scene_graph.collision_filter_manager()
    floor = GeometrySet(_floor_geometries(plant, scene_graph))
    for robot in bodies.values():
        robot.filter_collisions(filters, floor)
    moved = [*panels.values(), *(instances[model.name] for model in models if model.slides)]
    moved += [tray.model_instance() for tray in trays.values()]
    prescribed, anchored = GeometrySet([*_shapes_of(plant, moved)]), GeometrySet([*_anchored_shapes(plant)])
    filters.Apply(CollisionFilterDeclaration().ExcludeWithin(prescribed).ExcludeBetween(prescribed, anchored))
    if meshcat is not None:
        MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
    diagram = builder.Build()
    scene = Scene(diagram, plant, scene_graph, renderer_parameters) if render else None
    return WorldDiagram(
        diagram,
        plant,
        scene_graph,
        bodies,
        {**instances, **panels},
        trays,
        scenery,
        scene,
        lambda shown_in: rebuild(meshcat=shown_in),
    )


def try_geometry(directives: Path | None, models: Iterable[Path]) -> None:
    """Builds a world's geometry and some models, and throw them away. Raises InputError: Drake cannot use a file."""
    plant, _ = AddMultibodyPlant(MultibodyPlantConfig(), DiagramBuilder())
    parser, logger = parser_of(plant), logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.CRITICAL)  # what it would log is in the error
    try:
        if directives is not None:
            add_scenery(plant, directives, parser_of)
        for model in models:
            add_model(parser, model)
    finally:
        logger.setLevel(level)


def parser_of(plant: MultibodyPlant) -> Parser:
    """A parser that knows the package of the worlds and models."""
    parser = Parser(plant)
    parser.SetAutoRenaming(True)
    add_package(parser.package_map())
    return parser


def _add_model(plant: MultibodyPlant, parser: Parser, model: LooseModel) -> ModelInstanceIndex:
    instance = add_model(parser, model.path)
    plant.RenameModelInstance(instance, model.name)
    (index,) = plant.GetBodyIndices(instance)[:1]
    frame = plant.get_body(index).body_frame()
    if model.fixed:
        plant.WeldFrames(plant.world_frame(), frame, model.X_WM)
    elif model.slides:
        _let_slide(plant, frame, model)
    return instance


def _add_tray(plant: MultibodyPlant, parser: Parser, model: LooseModel) -> RigidBody:
    """A tray out of sight in the body of a person, without weight, since it is moved as the person wants."""
    instance = add_model(parser, TRAY_PATH)
    plant.RenameModelInstance(instance, f"{model.name}'s tray")
    plant.set_gravity_enabled(instance, False)
    (index,) = plant.GetBodyIndices(instance)
    tray = plant.get_body(index)
    plant.SetDefaultFloatingBaseBodyPose(tray, model.X_WM @ X_PT_HOME)
    return tray


def _let_slide(plant: MultibodyPlant, frame: Frame, model: LooseModel) -> None:
    """Holds a model upright at its height, by a planar joint."""
    x, y, z = model.X_WM.translation()
    level = RigidTransform(np.array([0.0, 0.0, z]))
    floor = plant.AddFrame(FixedOffsetFrame(f"{model.name}_floor", plant.world_frame(), level))
    joint = plant.AddJoint(PlanarJoint(f"{model.name}_slides", floor, frame))
    joint.set_default_translation(np.array([x, y]))
    joint.set_default_rotation(RollPitchYaw(model.X_WM.rotation()).yaw_angle())


def _shapes_of(plant: MultibodyPlant, instances: Sequence[ModelInstanceIndex]) -> Iterator[GeometryId]:
    """The collision shapes of model instances."""
    for index in (body for instance in instances for body in plant.GetBodyIndices(instance)):
        yield from plant.GetCollisionGeometriesForBody(plant.get_body(index))


def _anchored_shapes(plant: MultibodyPlant) -> Iterator[GeometryId]:
    """The collision shapes of all that is fixed to the world."""
    for body in (plant.get_body(BodyIndex(index)) for index in range(plant.num_bodies())):
        if plant.IsAnchored(body):
            yield from plant.GetCollisionGeometriesForBody(body)


def _floor_geometries(plant: MultibodyPlant, scene_graph: SceneGraph) -> list[GeometryId]:
    """Fixed collision boxes that end at the floor's height, and half spaces."""
    inspector = scene_graph.model_inspector()
    context = plant.CreateDefaultContext()
    floor = []
    for body in (plant.get_body(BodyIndex(index)) for index in range(plant.num_bodies())):
        if not plant.IsAnchored(body):
            continue
        X_WB = plant.EvalBodyPoseInWorld(context, body)
        for geometry in plant.GetCollisionGeometriesForBody(body):
            shape = inspector.GetShape(geometry)
            top_m = (X_WB @ inspector.GetPoseInFrame(geometry)).translation()[2]
            if isinstance(shape, Box):
                top_m += shape.height() / 2
            if isinstance(shape, Box | HalfSpace) and top_m <= FLOOR_TOP_M:
                floor.append(geometry)
    return floor


_MATERIAL: Final = "material"
_FRICTION: Final = "coulomb_friction"


def multiply_friction(plant: MultibodyPlant, scene_graph: SceneGraph, factor: float) -> None:
    """Multiplies the friction coefficients of all bodies that are not fixed to the world; the plant is finalized."""
    inspector, source = scene_graph.model_inspector(), plant.get_source_id()
    for body in (plant.get_body(BodyIndex(index)) for index in range(plant.num_bodies())):
        for geometry in () if plant.IsAnchored(body) else plant.GetCollisionGeometriesForBody(body):
            properties = ProximityProperties(inspector.GetProximityProperties(geometry))
            known = properties.GetPropertyOrDefault(_MATERIAL, _FRICTION, CoulombFriction(1.0, 1.0))
            changed = CoulombFriction(factor * known.static_friction(), factor * known.dynamic_friction())
            properties.UpdateProperty(_MATERIAL, _FRICTION, changed)
            scene_graph.AssignRole(source, geometry, properties, RoleAssign.kReplace)
