"""A robot of the tests' own: two wheels, a LiDAR, a camera on a mast, an arm of six joints, two fingers; meshes."""

import trimesh

CHAIN = (
    # joint, parent, place in the parent, axis, limits, effort, then the box of its link: middle and size
    ("shoulder_yaw", "shoulder_mount", "0 0 0", "0 0 1", (-2.9, 2.9), 60, "0 0 0.05", "0.10 0.10 0.10", 2.0),
    ("shoulder_pitch", "shoulder_yaw_link", "0 0 0.10", "0 1 0", (-2.6, 2.0), 90, "0.19 0 0", "0.38 0.07 0.07", 2.5),
    ("elbow", "shoulder_pitch_link", "0.40 0 0", "0 1 0", (-2.7, 2.7), 60, "0.17 0 0", "0.34 0.06 0.06", 1.8),
    ("wrist_roll", "elbow_link", "0.36 0 0", "1 0 0", (-3.0, 3.0), 25, "0.02 0 0", "0.06 0.05 0.05", 0.6),
    ("wrist_pitch", "wrist_roll_link", "0 0 0", "0 1 0", (-1.9, 1.9), 25, "0.03 0 0", "0.06 0.06 0.06", 0.6),
    ("hand_roll", "wrist_pitch_link", "0 0 0", "1 0 0", (-3.0, 3.0), 15, "0.07 0 0", "0.08 0.06 0.12", 0.7),
)


def inertial(mass, middle="0 0 0", size=0.1):
    moment = mass * size * size / 6
    return (
        f'<inertial><origin xyz="{middle}"/><mass value="{mass}"/><inertia ixx="{moment:.6g}" iyy="{moment:.6g}" '
        f'izz="{moment:.6g}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def link(name, mass, shape, middle="0 0 0", rpy="0 0 0", size=0.1):
    both = "".join(
        f'<{role}><origin xyz="{middle}" rpy="{rpy}"/><geometry>{shape}</geometry></{role}>'
        for role in ("visual", "collision")
    )
    return f'<link name="{name}">{inertial(mass, middle, size)}{both}</link>'


def joint(name, kind, parent, child, place="0 0 0", rpy="0 0 0", axis=None, limit=None):
    axis = "" if axis is None else f'<axis xyz="{axis}"/>'
    limit = "" if limit is None else '<limit lower="{}" upper="{}" effort="{}" velocity="{}"/>'.format(*limit)
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{place}" rpy="{rpy}"/>{axis}{limit}</joint>'
    )


def box(size):
    return f'<box size="{size}"/>'


def mesh(name):
    return f'<mesh filename="package://rover_description/meshes/{name}"/>'


def arm():
    for name, parent, place, axis, (low, high), effort, middle, size, mass in CHAIN:
        yield link(f"{name}_link", mass, box(size), middle)
        yield joint(name, "revolute", parent, f"{name}_link", place, "0 0 0", axis, (low, high, effort, 2.5))


def gripper():
    """Fingers that slide along y of a frame that is turned about the arm's last axis; closed at 0."""
    yield link("palm", 0.3, box("0.03 0.13 0.05"), "0.115 0 0")
    yield joint("palm_mount", "fixed", "hand_roll_link", "palm", "0 0 0", "1.5707963 0 0")
    for name, side in (("left", 1), ("right", -1)):
        yield link(f"{name}_finger", 0.08, box("0.07 0.014 0.024"), f"0.035 {0.007 * side} 0", size=0.05)
        yield joint(
            f"{name}_finger_slide", "prismatic", "palm", f"{name}_finger", "0.13 0 0", "0 0 0", f"0 {side} 0",
            (0.0, 0.05, 60, 0.1),
        )  # fmt: skip


def head():
    """Joints of pan and tilt on the mast."""
    yield link("pan_link", 0.3, box("0.05 0.05 0.05"))
    yield joint("head_pan", "revolute", "mast", "pan_link", "0.05 0 0.9", axis="0 0 1", limit=(-1.5, 1.5, 5, 1.5))
    yield joint(
        "head_tilt", "revolute", "pan_link", "camera_link", "0.05 0 0.03", axis="0 1 0", limit=(-0.7, 1.4, 5, 1.5)
    )


def urdf(*, with_arm=True, with_gripper=True, with_head=False, eye=(0.9, 0.6)):
    """The robot's URDF text; without a head its camera is fixed to the mast: `eye` has its height and tilt there."""
    fixed = joint("camera_mount", "fixed", "mast", "camera_link", f"0.05 0 {eye[0]}", f"0 {eye[1]} 0")
    wheel = '<cylinder radius="0.08" length="0.03"/>'
    parts = [
        link("base_link", 40, mesh("base.stl"), "0 0 0.12", size=0.4),
        '<link name="base_footprint"/>',
        joint("base", "fixed", "base_footprint", "base_link", "0 0 0.03"),
        *(link(f"{name}_wheel", 1.5, wheel, rpy="1.5707963 0 0") for name in ("left", "right")),
        joint("left_wheel_turn", "continuous", "base_link", "left_wheel", "0 0.22 0.05", axis="0 1 0"),
        joint("right_wheel_turn", "continuous", "base_link", "right_wheel", "0 -0.22 0.05", axis="0 1 0"),
        link("laser", 0.2, '<cylinder radius="0.04" length="0.05"/>'),
        joint("laser_mount", "fixed", "base_link", "laser", "0.22 0 0.30"),
        link("mast", 3.0, mesh("mast.obj"), "0 0 0.45"),
        joint("mast_mount", "fixed", "base_link", "mast", "-0.15 0 0.22"),
        link("camera_link", 0.2, mesh("eye.dae")),
        *(head() if with_head else (fixed,)),
        '<link name="camera_optical_frame"/>',
        joint("camera_optical", "fixed", "camera_link", "camera_optical_frame", "0.02 0 0", "-1.5707963 0 -1.5707963"),
    ]
    if with_arm:
        parts += [
            link("shoulder_mount", 1.0, box("0.12 0.12 0.2"), "0 0 -0.1"),
            joint("arm_mount", "fixed", "base_link", "shoulder_mount", "0.12 0 0.42"),
            *arm(),
            *(gripper() if with_gripper else ()),
        ]
    return '<?xml version="1.0"?>\n<robot name="rover">\n' + "\n".join(parts) + "\n</robot>\n"


def write_package(folder, **options):
    """Writes the package rover_description into a folder; returns the path of its URDF."""
    home = folder / "rover_description"
    (home / "meshes").mkdir(parents=True)
    (home / "urdf").mkdir()
    trimesh.creation.box((0.5, 0.4, 0.2)).export(home / "meshes/base.stl")
    trimesh.creation.box((0.04, 0.04, 0.9)).export(home / "meshes/mast.obj")
    trimesh.creation.box((0.03, 0.12, 0.03)).export(home / "meshes/eye.dae")
    (home / "package.xml").write_text("<package><name>rover_description</name></package>\n")
    path = home / "urdf/rover.urdf"
    path.write_text(urdf(**options))
    return path
