"""A base with a laser in sixty lines of rclpy, as Nav2's robots are: `python rclpy_base.py MAP.yaml X Y YAW`.

Takes TwistStamped, publishes odom, tf, tf_static and scan below /alice. Prints where it stands when Ctrl-C ends it.
"""

import math
import sys
from pathlib import Path

import cv2
import numpy as np
import rclpy
import yaml
from geometry_msgs.msg import TransformStamped, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

PERIOD_S, WATCHDOG_S, BEAMS, REACH_M = 0.05, 0.5, 360, 12.0


class Base(Node):
    def __init__(self, file, x, y, yaw):
        super().__init__("base", namespace="alice")
        told = yaml.safe_load(file.read_text())
        self.resolution, self.corner = told["resolution"], np.array(told["origin"][:2])
        self.walls = np.flipud(cv2.imread(str(file.with_name(told["image"])), cv2.IMREAD_GRAYSCALE)) < 100
        self.pose, self.begin, self.velocity, self.ticks = [x, y, yaw], (x, y, yaw), (0.0, 0.0), 0
        self.heard = self.get_clock().now()
        self.odom = self.create_publisher(Odometry, "odom", 10)
        self.tf = self.create_publisher(TFMessage, "/tf", 10)
        self.scan = self.create_publisher(LaserScan, "scan", qos_profile_sensor_data)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        mounted = TransformStamped(child_frame_id="base_laser")
        mounted.header.frame_id, mounted.transform.rotation.w, mounted.transform.translation.z = "base_link", 1.0, 0.29
        self.fixed = self.create_publisher(TFMessage, "/tf_static", latched)
        self.fixed.publish(TFMessage(transforms=[mounted]))
        self.create_subscription(TwistStamped, "cmd_vel", self.hear, 10)
        self.create_timer(PERIOD_S, self.step)

    def hear(self, message):
        self.heard, self.velocity = self.get_clock().now(), (message.twist.linear.x, message.twist.angular.z)

    def step(self):
        now = self.get_clock().now()
        v, w = self.velocity if (now - self.heard).nanoseconds < 1e9 * WATCHDOG_S else (0.0, 0.0)
        x, y, yaw = self.pose
        self.pose = [x + v * math.cos(yaw) * PERIOD_S, y + v * math.sin(yaw) * PERIOD_S, yaw + w * PERIOD_S]
        (x, y, yaw), (x0, y0, yaw0) = self.pose, self.begin
        cosine, sine = math.cos(yaw0), math.sin(yaw0)
        told = Odometry(child_frame_id="base_link")
        told.header.stamp, told.header.frame_id, at = now.to_msg(), "odom", told.pose.pose
        at.position.x = cosine * (x - x0) + sine * (y - y0)
        at.position.y = cosine * (y - y0) - sine * (x - x0)
        at.orientation.z, at.orientation.w = math.sin((yaw - yaw0) / 2), math.cos((yaw - yaw0) / 2)
        told.twist.twist.linear.x, told.twist.twist.angular.z = v, w
        self.odom.publish(told)
        moved = TransformStamped(header=told.header, child_frame_id="base_link")
        moved.transform.translation.x, moved.transform.translation.y = at.position.x, at.position.y
        moved.transform.rotation = at.orientation
        self.tf.publish(TFMessage(transforms=[moved]))
        self.ticks += 1
        if self.ticks % 2 == 0:
            self.scan.publish(self.look(told.header.stamp))

    def look(self, stamp):
        told = LaserScan(angle_min=-math.pi, angle_increment=2 * math.pi / BEAMS, range_min=0.05, range_max=REACH_M)
        told.header.stamp, told.header.frame_id = stamp, "base_laser"
        angles, far_m = told.angle_min + told.angle_increment * np.arange(BEAMS), np.arange(0.05, REACH_M, 0.01)
        ways = np.stack([np.cos(angles + self.pose[2]), np.sin(angles + self.pose[2])], axis=1)
        cells = (self.pose[:2] + far_m[:, None, None] * ways - self.corner) / self.resolution
        columns, rows = (np.clip(cells[..., n].astype(int), 0, self.walls.shape[1 - n] - 1) for n in (0, 1))
        hits = self.walls[rows, columns]
        ranges = np.where(hits.any(axis=0), far_m[hits.argmax(axis=0)], np.inf)
        told.ranges = (ranges + np.random.default_rng().normal(0.0, 0.01, BEAMS)).tolist()
        return told


if __name__ == "__main__":
    rclpy.init()
    base = Base(Path(sys.argv[1]), *map(float, sys.argv[2:]))
    try:
        rclpy.spin(base)
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        sys.stdout.write(" ".join(f"{each:.3f}" for each in base.pose) + "\n")
