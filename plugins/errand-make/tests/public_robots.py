"""Two public robots of simple shapes, written after their makers' published dimensions: Fetch and TurtleBot3 Waffle."""

from rover_urdf import box, joint, link

FETCH_ARM = (
    # joint, place in the parent, axis, limits, effort, velocity, length of the link
    ("shoulder_pan", "0.119525 0 0.34858", "0 0 1", (-1.6056, 1.6056), 33.8, 1.256, 0.117, 2.56),
    ("shoulder_lift", "0.117 0 0.06", "0 1 0", (-1.221, 1.518), 131.8, 1.454, 0.219, 2.66),
    ("upperarm_roll", "0.219 0 0", "1 0 0", (-3.14, 3.14), 76.9, 1.571, 0.133, 2.33),
    ("elbow_flex", "0.133 0 0", "0 1 0", (-2.251, 2.251), 66.2, 1.521, 0.197, 2.1),
    ("forearm_roll", "0.197 0 0", "1 0 0", (-3.14, 3.14), 29.4, 1.571, 0.1245, 1.66),
    ("wrist_flex", "0.1245 0 0", "0 1 0", (-2.16, 2.16), 25.7, 2.268, 0.1385, 1.73),
    ("wrist_roll", "0.1385 0 0", "1 0 0", (-3.14, 3.14), 7.4, 2.268, 0.12, 0.14),
)
OPTICAL = "-1.5707963 0 -1.5707963"


def cylinder(radius, length):
    return f'<cylinder radius="{radius}" length="{length}"/>'


def wheels(names, y, z, radius, width):
    """Two driven wheels beside the base's link."""
    for name, side in zip(names, (1, -1), strict=True):
        yield link(name, 2, cylinder(radius, width), rpy="1.5707963 0 0")
        yield joint(f"{name}_joint", "continuous", "base_link", name, f"0 {side * y} {z}", axis="0 1 0")


def fetch():
    """Fetch: a round base with a torso that slides up, a head and an arm of seven joints with two fingers."""
    parts = [
        link("base_link", 70, cylinder(0.28, 0.3), "0 0 0.2", size=0.5),
        *wheels(("l_wheel_link", "r_wheel_link"), 0.18738, 0.055325, 0.055325, 0.03),
        link("laser_link", 0.3, cylinder(0.03, 0.05)),
        joint("laser_mount", "fixed", "base_link", "laser_link", "0.235 0 0.2878"),
        link("torso_lift_link", 13, box("0.2 0.3 0.6"), "-0.05 0 0.2", size=0.4),
        joint(
            "torso_lift_joint", "prismatic", "base_link", "torso_lift_link", "-0.086875 0 0.37743",
            axis="0 0 1", limit=(0.0, 0.38615, 450, 0.1),
        ),
        link("head_pan_link", 2, box("0.14 0.1 0.06"), "0.07 0 0.03"),
        joint(
            "head_pan_joint", "revolute", "torso_lift_link", "head_pan_link", "0.053125 0 0.603",
            axis="0 0 1", limit=(-1.57, 1.57, 0.32, 1.57),
        ),
        link("head_tilt_link", 0.9, box("0.06 0.24 0.06"), "0.03 0 0.02"),
        joint(
            "head_tilt_joint", "revolute", "head_pan_link", "head_tilt_link", "0.14253 0 0.057999",
            axis="0 1 0", limit=(-0.76, 1.45, 0.68, 1.57),
        ),
        '<link name="head_camera_rgb_optical_frame"/>',
        joint("camera", "fixed", "head_tilt_link", "head_camera_rgb_optical_frame", "0.055 0.02 0.0225", OPTICAL),
    ]  # fmt: skip
    parent = "torso_lift_link"
    for name, place, axis, limits, effort, velocity, length, mass in FETCH_ARM:
        child = f"{name}_link"
        parts.append(link(child, mass, box(f"{length} 0.09 0.09"), f"{length / 2} 0 0"))
        parts.append(
            joint(f"{name}_joint", "revolute", parent, child, place, axis=axis, limit=(*limits, effort, velocity))
        )
        parent = child
    parts += [
        link("gripper_link", 1.5, box("0.06 0.13 0.07"), "-0.06 0 0"),
        joint("gripper_axis", "fixed", "wrist_roll_link", "gripper_link", "0.16645 0 0"),
    ]
    for name, side in (("r", 1), ("l", -1)):
        finger = f"{name}_gripper_finger"
        parts.append(link(f"{finger}_link", 0.08, box("0.062 0.014 0.026"), f"0 {0.007 * side} 0", size=0.03))
        parts.append(
            joint(
                f"{finger}_joint",
                "prismatic",
                "gripper_link",
                f"{finger}_link",
                axis=f"0 {side} 0",
                limit=(0.0, 0.05, 60, 0.05),
            )
        )
    return '<robot name="fetch">\n' + "\n".join(parts) + "\n</robot>\n"


def waffle():
    """TurtleBot3 Waffle: a flat base ahead of two casters, with a LiDAR and a camera that do not move."""
    caster = '<sphere radius="0.005"/>'
    parts = [
        '<link name="base_footprint"/>',
        link("base_link", 1.37, box("0.266 0.266 0.094"), "-0.064 0 0.047", size=0.2),
        joint("base_joint", "fixed", "base_footprint", "base_link", "0 0 0.010"),
        *wheels(("wheel_left_link", "wheel_right_link"), 0.144, 0.023, 0.033, 0.018),
        *(link(f"caster_{side}_link", 0.005, caster, size=0.005) for side in ("right", "left")),
        joint("caster_right", "fixed", "base_link", "caster_right_link", "-0.177 -0.064 -0.004"),
        joint("caster_left", "fixed", "base_link", "caster_left_link", "-0.177 0.064 -0.004"),
        link("base_scan", 0.114, cylinder(0.055, 0.0315), size=0.05),
        joint("scan_joint", "fixed", "base_link", "base_scan", "-0.064 0 0.122"),
        link("camera_link", 0.035, box("0.012 0.132 0.020"), "0.005 0.011 0.013", size=0.02),
        joint("camera_joint", "fixed", "base_link", "camera_link", "0.064 -0.011 0.094"),
        '<link name="camera_rgb_optical_frame"/>',
        joint("camera_rgb", "fixed", "camera_link", "camera_rgb_optical_frame", "0.003 0.011 0.009", OPTICAL),
    ]
    return '<robot name="waffle">\n' + "\n".join(parts) + "\n</robot>\n"
