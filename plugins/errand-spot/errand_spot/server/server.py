"""The server: all services of one robot on one port with TLS, and the thread that steps it."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from typing import Final

import grpc

from errand_spot.server import (
    data_acquisition,
    docking,
    downloads,
    identity,
    joint_control,
    manipulation,
    pictures,
    rays,
    state,
    streams,
    surface_contact,
)
from errand_spot.server.calls import Service, handlers
from errand_spot.server.commands import PowerService, RobotCommandService
from errand_spot.server.computer import Computer, Pace, Solver
from errand_spot.server.estop import EstopService, Tablet
from errand_spot.server.graph_map import Perception
from errand_spot.server.graph_nav import GraphNavService, Live
from errand_spot.server.identity import DOMAIN, Credentials
from errand_spot.server.keepalive import KeepaliveService
from errand_spot.server.leases import LeaseService
from errand_spot.server.pace import Pacer
from skills.robot import Clock, Pose2D, Robot

_MOST_BYTES: Final = 64 * 1024**2
_THREADS: Final = 24
LISTED: Final[Mapping[str, str]] = {
    "auto-return": "bosdyn.api.auto_return.AutoReturnService",
    "autowalk-service": "bosdyn.api.autowalk.AutowalkService",
    "choreography": "bosdyn.api.spot.ChoreographyService",
    "data": "bosdyn.api.DataService",
    "door": "bosdyn.api.spot.DoorService",
    "map-processing-service": "bosdyn.api.graph_nav.MapProcessingService",
    "payload-registration": "bosdyn.api.PayloadRegistrationService",
    "recording-service": "bosdyn.api.graph_nav.GraphNavRecordingService",
    "spot-check": "bosdyn.api.spot.SpotCheckService",
}
"""Services of a real Spot in the directory that answer UNIMPLEMENTED."""
SERVICES: Final = tuple(sorted(Service.__subclasses__(), key=lambda service: service.name))
"""Services that are served."""
MOTIONS: Final = (
    "stand with height, pitch, turn and shift, sit, velocity, trajectory, follow arm, stance, stop, freeze, safe power "
    "off, self-right; the arm's joint moves, named positions, Cartesian moves, impedance without force, gaze, velocity "
    "and stop; the gripper; joint control. Others are refused as unsupported."
)
"""The motions of `RobotCommand`, in words."""
_DESCRIBED_IN: Final = (
    *("auth", "data_buffer", "directory_registration", "directory", "estop", "fault", "image", "lease", "license"),
    *("gripper_camera_param", "local_grid"),
    *("payload", "point_cloud", "power", "robot_command", "robot_id", "robot_state", "time_sync", "world_object"),
    *("docking.docking", "manipulation_api", "ray_cast", "log_status.log_status", "spot.inverse_kinematics"),
    *("arm_surface_contact", "data_acquisition", "data_acquisition_store", "keepalive.keepalive"),
    "graph_nav.graph_nav",
    "mission.mission",
)
"""Files of the SDK that describe the services; importing them registers their descriptions."""


@dataclass(frozen=True)
class Options:
    """Options of a server: users with their passwords, port (0 takes a free one), pace, and the operator's tablet.

    `picker` picks up objects for the manipulation service, which otherwise refuses picks. `dock_O` is the robot's pose
    on its dock, in `odom`. Without `perception` only odometry localises the robot, and no tags are detected.
    `interceptors` see each call. With `downloads` a second port gives captures as files.
    """

    passwords: Mapping[str, str]
    port: int = 0
    pace: Pace = Pace.REAL
    tablet: Tablet = Tablet.TABLET
    picker: manipulation.Picker | None = None
    dock_O: Pose2D | None = None
    perception: Perception | None = None
    interceptors: Sequence[grpc.ServerInterceptor] = ()
    downloads: bool = False


class SpotServer:
    """Server of the API for one robot; it stands still before `run`."""

    def __init__(
        self, robot: Robot, clock: Clock, solver: Solver | None, credentials: Credentials, options: Options
    ) -> None:
        """Opens the port on 127.0.0.1. Raises OSError when it is in use."""
        for name in _DESCRIBED_IN:
            importlib.import_module(f"bosdyn.api.{name}_service_pb2")
        estop = EstopService(options.tablet)
        leases = LeaseService(lambda: self.computer.now_s(), lambda parts: self.computer.lost(parts))
        self.computer = Computer(
            robot, clock, leases=leases, estop=estop, solver=solver, pace=options.pace, dock_O=options.dock_O
        )
        self.certificate = credentials.certificate
        auth = identity.AuthService(options.passwords, credentials.token_key.read_bytes())
        self._store = data_acquisition.Store()
        self.services = self._services(leases, estop, auth, robot.name, options)
        self.downloads = downloads.Downloads(self._store, credentials, auth.user_of) if options.downloads else None
        self._grpc = grpc.server(
            ThreadPoolExecutor(_THREADS, thread_name_prefix="spot-api"),
            interceptors=list(options.interceptors),
            options=[
                ("grpc.max_receive_message_length", _MOST_BYTES),
                ("grpc.max_send_message_length", _MOST_BYTES),
                ("grpc.so_reuseport", 0),
            ],
        )
        if options.pace is Pace.CLIENT:
            self._grpc.add_generic_rpc_handlers([Pacer(self.computer)])
        self._grpc.add_generic_rpc_handlers(handlers(self.services, auth.user_of, self.computer.now_s))
        key, certificate = credentials.private_key.read_bytes(), credentials.certificate.read_bytes()
        try:
            self.port = self._grpc.add_secure_port(
                f"127.0.0.1:{options.port}", grpc.ssl_server_credentials([(key, certificate)])
            )
        except RuntimeError as error:
            raise OSError(f"port {options.port} of 127.0.0.1 cannot be opened") from error

    def _services(
        self, leases: LeaseService, estop: EstopService, auth: identity.AuthService, robot_name: str, options: Options
    ) -> Sequence[Service]:
        """All implemented services; the directory lists them and the others."""
        computer, clocks, updates = self.computer, identity.TimeSyncService(), joint_control.Updates()
        others = [(name, type_name, f"api.{DOMAIN}") for name, type_name in LISTED.items()]
        known = [(each.name, each.type, each.authority) for each in SERVICES]
        of_arm = {state.InverseKinematicsService.name, surface_contact.ArmSurfaceContactService.name}
        lacking = of_arm if computer.solver is None else set()
        if computer.capabilities.lidar_height_m is None:
            lacking |= {pictures.PointCloudService.name, pictures.LocalGridService.name}
        entries = [entry for entry in (*known, *others) if entry[0] not in lacking]
        directory = identity.DirectoryService(entries, computer.now_s)
        faults = state.FaultService(computer.now_s, directory.silent)
        live = Live(
            state.RobotStateService(computer, faults.faults),
            pictures.PointCloudService(computer),
            pictures.LocalGridService(computer),
            state.WorldObjectService(computer, options.perception),
        )
        gripper_camera = pictures.GripperCameraParamService()
        images = pictures.ImageService(computer, gripper_camera)
        store, captured = self._store, data_acquisition.states_of(live.states, live.objects)
        commands = RobotCommandService(computer, leases, clocks, updates)
        made: list[Service] = [
            auth,
            identity.RobotIdService(robot_name),
            directory,
            identity.DirectoryRegistrationService(directory),
            identity.LicenseService(),
            clocks,
            estop,
            leases,
            KeepaliveService(computer),
            PowerService(computer, leases),
            commands,
            surface_contact.ArmSurfaceContactService(commands),
            joint_control.RobotCommandStreamingService(computer, updates),
            images,
            gripper_camera,
            data_acquisition.DataAcquisitionService(images, captured, store),
            data_acquisition.DataAcquisitionStoreService(store),
            rays.RayCastService(computer),
            manipulation.ManipulationService(computer, leases, options.picker, images.sizes),
            docking.DockingService(computer, leases, clocks),
            state.InverseKinematicsService(computer),
            *vars(live).values(),
            faults,
            state.PayloadService(),
            state.DataBufferService(),
            state.LogStatusService(),
            streams.RobotStateStreamingService(computer, updates),
            streams.MissionService(),
            GraphNavService(computer, leases, clocks, options.perception, live),
        ]
        return [service for service in made if service.name not in lacking]

    @contextmanager
    def running(self) -> Iterator[SpotServer]:
        """Answers calls. The caller steps the robot: with `computer.run`, or with `computer.step`.

        The thread that built a simulation must step it, because its renderer belongs to that thread.
        """
        self._grpc.start()
        try:
            with self.downloads.running() if self.downloads is not None else nullcontext():
                yield self
        finally:
            self._grpc.stop(0.5).wait()
