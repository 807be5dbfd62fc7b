"""Builds the Drake Diagram of a world with its robots, people and loose objects.

A link welded to the world is still a body for Drake, and costs time in every step. So the builder parses the directives
into a temporary plant, and registers the shapes of its welded models, the scenery, on the world body. A model with a
moving part stays a model.
"""

import logging
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from pydrake.geometry import (
    Box,
    CollisionFilterDeclaration,
    DefaultProximityProperties,
    GeometryId,
    GeometryInstance,
    GeometrySet,
    HalfSpace,
    Meshcat,
    MeshcatVisualizer,
    PerceptionProperties,
    ProximityProperties,
    RenderEngineVtkParams,
    RoleAssign,
    SceneGraph,
    SceneGraphConfig,
    SceneGraphInspector,
)
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.parsing import (
    FlattenModelDirectives,
    GetScopedFrameByName,
    LoadModelDirectives,
    ModelDirective,
    ModelDirectives,
    Parser,
    ProcessModelDirectives,
)
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import BodyIndex, FixedOffsetFrame, Frame, ModelInstanceIndex, PlanarJoint, RigidBody
from pydrake.systems.framework import Diagram, DiagramBuilder

from plant.events import add_panel
from plant.models.person_arms import Arms
from plant.models.person_figure import Figure
from plant.rendering import Scene
from plant.robots.robot_kind import PlacedRobot, RobotBody, robot_kind
from plant.sensors.ray_shapes import outlines_W
from plant.worlds.geometry_files import OWN_PACKAGE
from plant.worlds.seeding import PointRoute, Receiving
from plant.worlds.world import DoorRule, add_package
from skills.inputs.errors import InputError
from skills.robot import FloatArray

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

    scratch, scene_graph = MultibodyPlant(TIME_STEP_S), SceneGraph()  # pydrake never frees an unbuilt builder
    scratch.RegisterAsSourceForSceneGraph(scene_graph)
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
        text = _RELATIVE_URI.sub(rf"<uri>{path.parent.as_uri()}/\1</uri>", path.read_text(encoding="utf-8"))
        with suppress(RuntimeError):  # parses the file again, for a message that names it
            return _only(parser.AddModelsFromString(text, "sdf"))
    try:
        return _only(parser.AddModels(str(path)))
    except (RuntimeError, ValueError) as error:
        raise _refused(path, error) from error


def _refused(file: Path, error: Exception) -> InputError:
    """Error that quotes Drake's message about a file, in one line."""
    reason = " ".join(str(error).split()) or type(error).__name__
    return InputError(f"the simulation cannot use it: {reason[:300]}", hint="correct the file", file=file)


def _only(instances: Sequence[ModelInstanceIndex]) -> ModelInstanceIndex:
    (instance,) = instances
    return instance


def _process(directives: Sequence[ModelDirective], plant: MultibodyPlant, parser: Parser) -> None:
    """Processes directives one by one."""
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
    """Registers the shapes of all fixed models on the world body of `plant`; returns the model name of each shape."""
    context, world, pieces = scratch.CreateDefaultContext(), plant.world_body(), {}
    for geometry in inspector.GetAllGeometryIds():
        body = scratch.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        if (model := _model_of(scratch, body.index())) in moving:
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
    """Names of the models with a moving part, and of models welded to them."""
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
    """Name, in the directives, of the model to which a body belongs."""
    instance = plant.get_body(body).model_instance()
    return str(plant.GetModelInstanceName(instance)).partition("::")[0]


TIME_STEP_S = 0.0125
NEAR_RIGID = 0.1
"""SAP's near-rigid threshold (Castro et al. 2022, section V.B); Drake's default of 1.0 lets 80 N press a fingertip
3 cm into a cube of 50 g."""
UNMESHED: Final = SceneGraphConfig(
    default_proximity_properties=DefaultProximityProperties(hydroelastic_modulus=None, resolution_hint=None)
)
"""Point contact needs no meshes; with Drake's defaults each context would mesh every collision shape."""
FLOOR_TOP_M = 0.01
TRAY_PATH = Path(__file__).parent / "models" / "tray" / "tray.sdf"
X_PT_HOME = RigidTransform(
    RotationMatrix(np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])), np.array([0.0, 0.0, 1.08])
)
"""Pose of an unused tray T in a person P: upright within the torso, the handle up."""


@dataclass(frozen=True)
class LooseModel:
    """A model added to the world at the start: X_WM is the pose of its base.

    A fixed model is welded there. A walking person has a `route`, moves upright in x, y and yaw, and passes through
    fixed shapes. A person who takes objects from robots is `receiving` and has a tray. A `figure` replaces the file.
    """

    name: str
    path: Path
    X_WM: RigidTransform
    fixed: bool = False
    route: PointRoute | None = None
    receiving: Receiving | None = None
    figure: Figure | None = None


@dataclass(frozen=True)
class DiagramConfig:
    """Contents of a Diagram: the directives of a world (None: an empty one), models, robots and doors.

    `visuals` draws robots with meshes if these are installed. `render` creates the scene for cameras, with light and
    sky from `renderer_parameters`. `friction` multiplies the friction coefficients of all moving bodies.
    """

    directives: Path | None = None
    models: Sequence[LooseModel] = ()
    robots: Sequence[PlacedRobot] = ()
    doors: Sequence[DoorRule] = ()
    visuals: bool = True
    render: bool = True
    renderer_parameters: RenderEngineVtkParams | None = None
    friction: float = 1.0


@dataclass(frozen=True)
class WorldDiagram:
    """The finished Diagram built from a `config`, with its parts by name.

    `models` includes the panels of doors. `trays` are the people's trays by name; `arms` hold them. `scenery` maps each
    collision shape on the world body to its model's name. `scene` renders the Diagram if the config requests it.
    """

    config: DiagramConfig
    diagram: Diagram
    plant: MultibodyPlant
    scene_graph: SceneGraph
    robots: Mapping[str, RobotBody]
    models: Mapping[str, ModelInstanceIndex]
    trays: Mapping[str, RigidBody]
    arms: Arms
    scenery: Mapping[GeometryId, str]
    scene: Scene | None


def build_diagram(config: DiagramConfig, meshcat: Meshcat | None = None) -> WorldDiagram:
    """Builds the Diagram of a world with its models, robots and doors, and publishes it to `meshcat`.

    The plant uses SAP with point contact at `TIME_STEP_S`. Sampled output ports would double the cost of a step and are
    off, so evaluating contact results solves again. Default positions place the models; the engine places the robots.
    """
    builder = DiagramBuilder()
    plant_config = MultibodyPlantConfig(
        time_step=TIME_STEP_S,
        contact_model="point",
        discrete_contact_approximation="sap",
        use_sampled_output_ports=False,
    )
    plant, scene_graph = AddMultibodyPlant(plant_config, UNMESHED, builder)
    plant.set_sap_near_rigid_threshold(NEAR_RIGID)
    parser = parser_of(plant)
    scenery = {} if config.directives is None else add_scenery(plant, config.directives, parser_of)
    instances = {model.name: _add_model(plant, parser, model) for model in config.models}
    panels = {door.name: add_panel(plant, door) for door in config.doors}
    trays = {model.name: _add_tray(plant, parser, model) for model in config.models if model.receiving is not None}
    placed = sorted(config.robots, key=lambda robot: robot.name)
    robots = {robot.name: robot_kind(robot.kind).add(plant, robot, config.visuals) for robot in placed}
    plant.Finalize()
    if config.friction != 1.0:
        multiply_friction(plant, scene_graph, config.friction)
    for model in config.models:
        if not (model.fixed or model.route is not None):
            (body,) = plant.GetBodyIndices(instances[model.name])[:1]
            plant.SetDefaultFloatingBaseBodyPose(plant.get_body(body), model.X_WM)
    walkers = [instances[model.name] for model in config.models if model.route is not None]
    moved = [*panels.values(), *walkers, *(tray.model_instance() for tray in trays.values())]
    _filter_collisions(plant, scene_graph, robots.values(), moved)
    people = [
        (plant.get_body(plant.GetBodyIndices(instances[model.name])[0]), trays.get(model.name), model.figure)
        for model in config.models
        if model.receiving is not None or model.figure is not None
    ]
    arms = Arms(builder, plant, scene_graph, people)
    if meshcat is not None:
        MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
    diagram = builder.Build()
    scene = Scene(diagram, plant, scene_graph, config.renderer_parameters, arms.pose) if config.render else None
    models = {**instances, **panels}
    return WorldDiagram(config, diagram, plant, scene_graph, robots, models, trays, arms, scenery, scene)


def _filter_collisions(
    plant: MultibodyPlant, scene_graph: SceneGraph, robots: Iterable[RobotBody], moved: Sequence[ModelInstanceIndex]
) -> None:
    """Applies the robots' filters; models with a prescribed pose pass through each other and fixed shapes."""
    filters = scene_graph.collision_filter_manager()
    floor = GeometrySet(_floor_geometries(plant, scene_graph))
    for robot in robots:
        robot.filter_collisions(filters, floor)
    bodies = [plant.get_body(BodyIndex(index)) for index in range(plant.num_bodies())]
    instances = {int(instance) for instance in moved}
    prescribed = GeometrySet(_shapes(plant, (body for body in bodies if int(body.model_instance()) in instances)))
    anchored = GeometrySet(_shapes(plant, (body for body in bodies if plant.IsAnchored(body))))
    filters.Apply(CollisionFilterDeclaration().ExcludeWithin(prescribed).ExcludeBetween(prescribed, anchored))


def try_geometry(directives: Path | None, models: Iterable[Path]) -> tuple[tuple[str, FloatArray], ...]:
    """Builds a world's geometry and models only to check them; returns the outlines of furniture and walls, with names.

    Raises InputError when Drake cannot use a file.
    """
    plant, scene_graph = AddMultibodyPlant(MultibodyPlantConfig(), DiagramBuilder())
    parser, logger = parser_of(plant), logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.CRITICAL)  # its message is part of the error
    try:
        pieces = {} if directives is None else add_scenery(plant, directives, parser_of)
        for model in models:
            add_model(parser, model)
    finally:
        logger.setLevel(level)
    plant.Finalize()
    found = outlines_W(plant, scene_graph.model_inspector())
    return tuple((pieces[shape], outline) for shape, outline in found if shape in pieces)


def parser_of(plant: MultibodyPlant) -> Parser:
    """Returns a parser that knows the package of the worlds and models."""
    parser = Parser(plant)
    parser.SetAutoRenaming(True)
    add_package(parser.package_map())
    return parser


def _add_model(plant: MultibodyPlant, parser: Parser, model: LooseModel) -> ModelInstanceIndex:
    if model.figure is None:
        instance = add_model(parser, model.path)
    else:
        instance = _only(parser.AddModelsFromString(model.figure.sdf(), "sdf"))
    plant.RenameModelInstance(instance, model.name)
    (index,) = plant.GetBodyIndices(instance)[:1]
    frame = plant.get_body(index).body_frame()
    if model.fixed:
        plant.WeldFrames(plant.world_frame(), frame, model.X_WM)
    elif model.route is not None:
        _let_slide(plant, frame, model)
    return instance


def _add_tray(plant: MultibodyPlant, parser: Parser, model: LooseModel) -> RigidBody:
    """Adds a person's tray: hidden in the torso and without gravity, because its pose is prescribed."""
    instance = add_model(parser, TRAY_PATH)
    plant.RenameModelInstance(instance, f"{model.name}'s tray")
    plant.set_gravity_enabled(instance, False)
    (index,) = plant.GetBodyIndices(instance)
    tray = plant.get_body(index)
    plant.SetDefaultFloatingBaseBodyPose(tray, model.X_WM @ X_PT_HOME)
    return tray


def _let_slide(plant: MultibodyPlant, frame: Frame, model: LooseModel) -> None:
    """Lets a model move upright at its height, by a planar joint."""
    x, y, z = model.X_WM.translation()
    level = RigidTransform(np.array([0.0, 0.0, z]))
    floor = plant.AddFrame(FixedOffsetFrame(f"{model.name}_floor", plant.world_frame(), level))
    joint = plant.AddJoint(PlanarJoint(f"{model.name}_slides", floor, frame))
    joint.set_default_translation(np.array([x, y]))
    joint.set_default_rotation(RollPitchYaw(model.X_WM.rotation()).yaw_angle())


def _shapes(plant: MultibodyPlant, bodies: Iterable[RigidBody]) -> list[GeometryId]:
    """Collision shapes of bodies."""
    return [shape for body in bodies for shape in plant.GetCollisionGeometriesForBody(body)]


def _floor_geometries(plant: MultibodyPlant, scene_graph: SceneGraph) -> list[GeometryId]:
    """Collision boxes and half spaces that are fixed to the world and whose top is at floor height."""
    inspector = scene_graph.model_inspector()
    context = plant.CreateDefaultContext()
    floor = []
    for body in filter(plant.IsAnchored, map(plant.get_body, map(BodyIndex, range(plant.num_bodies())))):
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
    """Multiplies the friction coefficients of all moving bodies of a finalized plant."""
    inspector, source = scene_graph.model_inspector(), plant.get_source_id()
    for body in (plant.get_body(BodyIndex(index)) for index in range(plant.num_bodies())):
        for geometry in () if plant.IsAnchored(body) else plant.GetCollisionGeometriesForBody(body):
            properties = ProximityProperties(inspector.GetProximityProperties(geometry))
            known = properties.GetPropertyOrDefault(_MATERIAL, _FRICTION, CoulombFriction(1.0, 1.0))
            changed = CoulombFriction(factor * known.static_friction(), factor * known.dynamic_friction())
            properties.UpdateProperty(_MATERIAL, _FRICTION, changed)
            scene_graph.AssignRole(source, geometry, properties, RoleAssign.kReplace)
