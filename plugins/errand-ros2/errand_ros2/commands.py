"""`errand ros2 bag` converts the log of a run to a ROS 2 bag; `errand serve-ros2` serves a simulated robot."""

from __future__ import annotations

from contextlib import closing, suppress
from pathlib import Path
from threading import Event
from typing import Annotated

import typer

from executive.cli.number_options import quantity_option
from executive.cli.options import START, start_pose
from executive.cli.output import new_folder
from executive.record.history import read_history
from skills.quantities import Delay, Seed

ros2 = typer.Typer(name="ros2", help="Logs as ROS 2 bags.", no_args_is_help=True, rich_markup_mode=None)


@ros2.callback()
def _group() -> None:
    """Logs as ROS 2 bags."""


@ros2.command()
def bag(
    file: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run, or its log.mcap.", show_default=False)],
    out: Annotated[Path, typer.Option("-o", "--out", help="New folder for the bag, or its file *.mcap.")],
    robot: Annotated[str | None, typer.Option(metavar="NAME", help="Only this one of several robots.")] = None,
) -> None:
    """Writes a ROS 2 bag: map, transforms, scans, joint states, poses, paths and pictures."""
    from errand_ros2.bag import write_bag, write_bag_file

    history = read_history(file)
    history = history if robot is None else history.of_robot(robot)
    if out.suffix == ".mcap":
        count = write_bag_file(history.events, out)
    else:
        with new_folder(out) as folder:
            count = write_bag(history.events, folder, out.resolve().name)
    typer.echo(f"{count} messages in {out}", err=True)


def serve_ros2(
    place: Annotated[
        str, typer.Argument(metavar="[DOMAIN][@HOST[:PORT]]", help="ROS domain, and address of the Zenoh router.")
    ] = "",
    world: Annotated[str, typer.Option("--world", help="A world by name or folder.")] = "flat",
    robot: Annotated[str, typer.Option("--robot", help="Name of the robot; in lower case its namespace.")] = "Alice",
    kind: Annotated[str, typer.Option("--kind", help="Kind of the robot.")] = "spot",
    start: START = None,
    seed: Annotated[int, quantity_option(Seed, help="Seed of the objects and of all noise.")] = 1,
    with_map: Annotated[bool, typer.Option("--map", help="Publish the world's map as /map, too.")] = False,
    truth: Annotated[bool, typer.Option("--ground-truth", help="Publish the true pose under /ground_truth.")] = False,
    limit: Annotated[
        float | None, quantity_option(Delay, "--for", help="End after this time (s) on the robot's clock.")
    ] = None,
) -> None:
    """Serves a simulated robot in ROS 2, without navigation, until Ctrl-C."""
    from errand_ros2.adapter.description import capabilities_of
    from errand_ros2.server import RobotServer
    from errand_ros2.wire.node import Place, open_session
    from errand_ros2.wire.types import topic_name
    from executive.app.prepare.placed_robots import only_robot, refuse_blocked
    from executive.app.prepare.worlds import open_world
    from executive.app.runs.simulated import compile_first, simulate
    from executive.record.other_tools import ros_name
    from skills.grid_map import load_grid_map

    at, opened, space = Place.parse(place), open_world(world), topic_name(f"/{ros_name(robot)}")
    capabilities_of(kind)
    placed = only_robot(robot, opened, seed=seed, start=start_pose(start), kind=kind)
    if start is not None:
        refuse_blocked(opened, placed.start)
    with open_session(at) as session:
        compile_first()
        simulation = simulate(opened, {robot: placed}, seed=seed, record=False)
        server = RobotServer(
            session,
            simulation.robots[robot],
            simulation.clock,
            grid=load_grid_map(opened.scan_map_path) if with_map else None,
            truth=(lambda: simulation.engine.poses_W()[robot]) if truth else None,
        )
        router = "the router is here" if session.is_router else "by its router"
        typer.echo(f"ROS 2: {space}, domain {at.domain}, {at.endpoint} ({router}; Ctrl-C ends it)")
        with closing(server), suppress(KeyboardInterrupt):
            server.run(Event(), limit)
