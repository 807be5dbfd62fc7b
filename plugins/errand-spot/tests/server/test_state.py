"""What clients read: state, pictures, points, objects."""

import time

import numpy as np
import pytest
from bosdyn.api import (
    gripper_camera_param_pb2,
    image_pb2,
    local_grid_pb2,
    point_cloud_pb2,
    ray_cast_pb2,
    service_fault_pb2,
    world_object_pb2,
)
from bosdyn.api.spot import inverse_kinematics_pb2
from bosdyn.client.directory_registration import ServiceAlreadyExistsError
from bosdyn.client.exceptions import InvalidRequestError
from bosdyn.client.fault import ServiceFaultAlreadyExistsError
from bosdyn.client.frame_helpers import get_a_tform_b, get_odom_tform_body
from bosdyn.client.image import build_image_request, depth_image_to_pointcloud
from bosdyn.client.inverse_kinematics import InverseKinematicsClient
from bosdyn.client.log_status import RequestIdDoesNotExistError as InvalidLogError
from bosdyn.client.point_cloud import PointCloudClient
from bosdyn.client.world_object import make_add_world_object_req, make_delete_world_object_req

from errand_spot.messages import api_joint, our_joint
from tests.tables import table

IkRequest = inverse_kinematics_pb2.InverseKinematicsRequest


@pytest.fixture
def robot(served):
    return served.login()


def test_the_state_has_the_joints_and_frames_of_a_spot(robot):
    state = robot.ensure_client("robot-state").get_robot_state()
    tree = state.kinematic_state.transforms_snapshot
    assert {"arm0.sh0", "arm0.wr1"} <= {joint.name for joint in state.kinematic_state.joint_states}
    assert get_odom_tform_body(tree).z == pytest.approx(0.2, abs=0.35)
    assert get_a_tform_b(tree, "arm0.link_wr1", "hand").x == pytest.approx(0.19557)
    assert (robot.has_arm(), robot.is_powered_on(), robot.is_estopped()) == (True, False, False)


@pytest.mark.parametrize(("ours", "theirs"), [("fl_hx", "fl.hx"), ("hr_kn", "hr.kn"), ("arm_f1x", "arm0.f1x")])
def test_joints_have_the_names_of_the_api(ours, theirs):
    assert (api_joint(ours), our_joint(theirs)) == (theirs, ours)


def present(faults_of):
    """Waits for the first faults."""
    while not (faults := faults_of()):
        time.sleep(0.02)
    return faults


def test_faults_of_the_robot_are_system_faults(served, robot):
    served.scripted.present_faults = ("motor too hot",)
    client = robot.ensure_client("robot-state")
    faults = present(lambda: client.get_robot_state().system_fault_state.faults)
    assert [fault.name for fault in faults] == ["motor too hot"]


def test_hardware_names_the_links_and_the_description(robot):
    hardware = robot.ensure_client("robot-state").get_robot_hardware_configuration()
    assert "<robot" in hardware.skeleton.urdf
    assert "arm0.link_wr1" in {link.name for link in hardware.skeleton.links}


def test_every_source_that_is_listed_gives_a_picture_of_its_size(robot):
    client = robot.ensure_client("image")
    sources = {source.name: source for source in client.list_image_sources()}
    assert {"hand_color_image", "hand_depth", "frontleft_fisheye_image", "back_depth_in_visual_frame"} <= set(sources)
    for name, source in sources.items():
        (answer,) = client.get_image_from_sources([name])
        assert (answer.shot.image.cols, answer.shot.image.rows) == (source.cols, source.rows)
        assert answer.shot.transforms_snapshot.child_to_parent_edge_map[answer.shot.frame_name_image_sensor]


def test_depth_is_in_millimetres_and_makes_a_point_cloud(robot):
    (answer,) = robot.ensure_client("image").get_image_from_sources(["frontleft_depth"])
    image, depth = answer.shot.image, np.frombuffer(answer.shot.image.data, np.uint16)
    assert (image.pixel_format, answer.source.depth_scale) == (image_pb2.Image.PIXEL_FORMAT_DEPTH_U16, 1000.0)
    assert (len(depth), len(depth_image_to_pointcloud(answer))) == (image.rows * image.cols, np.count_nonzero(depth))


# source -> width and height as on the robot, and the frame of its sensor
@pytest.mark.parametrize(*table(__file__, "sources"))
def test_pictures_have_the_size_and_the_frame_that_those_of_a_spot_have(robot, source, size, frame):
    (answer,) = robot.ensure_client("image").get_image_from_sources([source])
    assert [answer.shot.image.cols, answer.shot.image.rows] == size
    assert answer.shot.frame_name_image_sensor == frame


def test_depth_through_a_spots_lens_lies_on_the_wall(robot):
    (answer,) = robot.ensure_client("image").get_image_from_sources(["frontleft_depth"])
    body = get_a_tform_b(answer.shot.transforms_snapshot, "body", answer.shot.frame_name_image_sensor)
    points = body.transform_cloud(depth_image_to_pointcloud(answer))
    ahead = points[points[:, 2] > -0.2]
    assert len(ahead) > 100 and np.median(ahead[:, 0]) == pytest.approx(1.7, abs=0.05)


@pytest.mark.parametrize(("mode", "size"), [("MODE_1280_720", (1280, 720)), ("MODE_4208_3120", (4208, 3120))])
def test_the_mode_of_the_gripper_camera_changes_its_picture(robot, mode, size):
    client = robot.ensure_client("gripper-camera-param")
    mode = gripper_camera_param_pb2.GripperCameraParams.CameraMode.Value(mode)
    client.set_camera_params(gripper_camera_param_pb2.GripperCameraParamRequest(params={"camera_mode": mode}))
    colour, depth, registered = robot.ensure_client("image").get_image_from_sources(
        ["hand_color_image", "hand_depth", "hand_depth_in_hand_color_frame"]
    )
    assert (colour.shot.image.cols, colour.shot.image.rows) == size
    assert (registered.shot.image.cols, registered.shot.image.rows) == size
    assert colour.source.pinhole.intrinsics.principal_point.y == pytest.approx(size[1] / 2, rel=0.05)
    assert (depth.shot.image.cols, depth.shot.image.rows) == (224, 171)


def test_an_unknown_mode_of_the_gripper_camera_is_an_invalid_request(robot):
    client = robot.ensure_client("gripper-camera-param")
    with pytest.raises(InvalidRequestError):
        client.set_camera_params(gripper_camera_param_pb2.GripperCameraParamRequest(params={"camera_mode": 99}))


@pytest.mark.parametrize(*table(__file__, "pictures"))
def test_a_picture_that_cannot_be_given_says_why(robot, source, options, status):
    request = image_pb2.GetImageRequest(image_requests=[build_image_request(source, **options)])
    request.header.client_name = "test"
    answer = robot.ensure_client("image")._stub.GetImage(request).image_responses[0]
    assert image_pb2.ImageResponse.Status.Name(answer.status) == status


def test_a_picture_is_made_smaller(robot):
    (answer,) = robot.ensure_client("image").get_image([build_image_request("hand_color_image", resize_ratio=0.5)])
    assert answer.shot.image.cols == answer.source.cols
    assert answer.source.pinhole.intrinsics.principal_point.x == pytest.approx(answer.source.cols / 2, rel=0.1)


def test_the_lidar_sees_the_wall_ahead(robot):
    robot.sync_with_directory()
    robot.service_client_factories_by_type[PointCloudClient.service_type] = PointCloudClient
    client = robot.ensure_client("velodyne-point-cloud")
    cloud = client.get_point_cloud_from_sources(["velodyne-point-cloud"])[0].point_cloud
    assert cloud.encoding == point_cloud_pb2.PointCloud.ENCODING_XYZ_32F
    points = np.frombuffer(cloud.data, np.float32).reshape(-1, 3)
    ahead = points[(np.abs(points[:, 1]) < 0.2) & (points[:, 0] > 0.0)]
    assert ahead[:, 0].min() == pytest.approx(1.7, abs=0.1)


def test_objects_of_clients_are_added_and_deleted(robot):
    client = robot.ensure_client("world-objects")
    added = client.mutate_world_objects(make_add_world_object_req(world_object_pb2.WorldObject(name="crate")))
    (listed,) = client.list_world_objects().world_objects
    assert (listed.name, listed.id) == ("crate", added.mutated_object_id)
    client.mutate_world_objects(make_delete_world_object_req(listed))
    assert not client.list_world_objects().world_objects
    answer = client.mutate_world_objects(make_delete_world_object_req(listed))
    assert answer.status == world_object_pb2.MutateWorldObjectResponse.STATUS_INVALID_MUTATION_ID


def inverse_kinematics(robot, frame, **pose):
    robot.service_client_factories_by_type[InverseKinematicsClient.service_type] = InverseKinematicsClient
    request = IkRequest(root_frame_name=frame, tool_pose_task={"task_tform_desired_tool": pose} if pose else {})
    return robot.ensure_client("inverse-kinematics").inverse_kinematics(request)


@pytest.mark.parametrize(("x_m", "joints"), [(0.75, 6), (2.5, 0), (1e6, 0)])
def test_inverse_kinematics_says_what_is_in_reach(robot, x_m, joints):
    answer = inverse_kinematics(robot, "body", position={"x": x_m, "z": 0.3}, rotation={"w": 1.0})
    reached = answer.status == inverse_kinematics_pb2.InverseKinematicsResponse.STATUS_OK
    assert reached is bool(joints)
    assert not reached or len(answer.robot_configuration.joint_states) >= joints


def test_inverse_kinematics_in_an_unknown_frame_is_an_invalid_request(robot):
    with pytest.raises(InvalidRequestError):
        inverse_kinematics(robot, "moon")


def test_comments_and_events_are_taken(robot):
    robot.time_sync.wait_for_sync(timeout_sec=5.0)
    robot.operator_comment("seen")
    robot.time_sync.stop()


def test_the_local_grid_has_the_distance_to_the_wall(robot):
    client = robot.ensure_client("local-grid-service")
    assert [kind.name for kind in client.get_local_grid_types()] == ["obstacle_distance"]
    grid, none = client.get_local_grids(["obstacle_distance", "terrain"])
    assert none.status == local_grid_pb2.LocalGridResponse.STATUS_NO_SUCH_GRID
    grid = grid.local_grid
    metres = np.frombuffer(grid.data, np.int16).reshape(128, 128) * grid.cell_value_scale
    corner = get_a_tform_b(grid.transforms_snapshot, "odom", grid.frame_name_local_grid_data)
    assert metres[64, int((1.0 - corner.x) / grid.extent.cell_size)] == pytest.approx(0.7, abs=0.1)


def test_parameters_of_the_gripper_camera_are_kept(robot):
    client = robot.ensure_client("gripper-camera-param")
    request = gripper_camera_param_pb2.GripperCameraParamRequest(params={"brightness": {"value": 0.25}})
    client.set_camera_params(request)
    found = client.get_camera_params(gripper_camera_param_pb2.GripperCameraGetParamRequest())
    assert found.params.brightness.value == 0.25


def test_a_service_that_falls_silent_is_a_fault(robot):
    registration, states = robot.ensure_client("directory-registration"), robot.ensure_client("robot-state")
    mine = ("mine", "my.Service", "mine.spot.robot", "127.0.0.1", 5000)
    registration.register(*mine, liveness_timeout_secs=0.2)
    fault = present(lambda: states.get_robot_state().service_fault_state.faults)[0].fault_id
    assert (fault.service_name, fault.fault_name) == ("mine", "liveness")
    with pytest.raises(ServiceAlreadyExistsError):  # by which the SDK keeps a service alive
        registration.register(*mine, liveness_timeout_secs=0.2)
    assert not states.get_robot_state().service_fault_state.faults


def test_a_fault_of_a_client_is_listed_once_until_it_is_cleared(robot):
    client, states = robot.ensure_client("fault"), robot.ensure_client("robot-state")
    named = {"fault_name": "tired", "service_name": "mine"}
    fault = service_fault_pb2.ServiceFault(error_message="tired", fault_id=named)
    client.trigger_service_fault(fault)
    with pytest.raises(ServiceFaultAlreadyExistsError):
        client.trigger_service_fault(fault)
    (listed,) = states.get_robot_state().service_fault_state.faults
    assert listed.error_message == "tired"
    client.clear_service_fault(fault.fault_id)
    assert not states.get_robot_state().service_fault_state.faults


def cast(robot, direction, types=(), frame="body", least_m=0.0):
    """Casts a ray from 0.4 m ahead of the body's middle."""
    x, z = direction
    request = ray_cast_pb2.RaycastRequest(
        **{"ray_frame_name": frame, "intersection_types": types, "min_intersection_distance": least_m},
        ray={"origin": {"x": 0.4}, "direction": {"x": x, "z": z}},
    )
    return robot.ensure_client("ray-cast")._stub.Raycast(request)


@pytest.mark.parametrize(*table(__file__, "rays"))
def test_a_ray_that_cannot_be_cast_has_a_status(robot, direction, types, frame, status):
    assert ray_cast_pb2.RaycastResponse.Status.Name(cast(robot, direction, types, frame).status) == status


def test_a_ray_meets_the_wall_and_the_floor(robot):
    Hit = ray_cast_pb2.RayIntersection
    hits = cast(robot, (2.0, -0.4)).hits
    assert {hit.type for hit in hits} >= {Hit.TYPE_GROUND_PLANE, Hit.TYPE_VOXEL_MAP}
    assert [hit.distance_meters for hit in hits] == sorted(hit.distance_meters for hit in hits)
    wall = next(hit for hit in hits if hit.type == Hit.TYPE_VOXEL_MAP)
    assert wall.hit_position_in_hit_frame.x == pytest.approx(1.7, abs=0.05) or wall.hit_position_in_hit_frame.z < 0.05
    assert not cast(robot, (0.0, 1.0)).hits
    assert not cast(robot, (0.0, -1.0), [Hit.TYPE_GROUND_PLANE], least_m=5.0).hits


def test_no_logs_are_written(robot):
    client = robot.ensure_client("log-status")
    assert not client.get_active_log_statuses().log_statuses
    with pytest.raises(InvalidLogError):
        client.get_log_status("7")
