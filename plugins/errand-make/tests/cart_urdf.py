"""URDFs of a cart in parts: a base on wheels, casters, arms, fingers, heads and what makers' files have besides."""

from rover_urdf import box, joint, link

WHEEL = '<cylinder radius="0.1" length="0.04"/>'


def robot(*parts):
    """URDF text, one part a line."""
    lines = [each for part in parts for each in ((part,) if isinstance(part, str) else part)]
    return '<?xml version="1.0"?>\n<robot name="cart">\n' + "\n".join(lines) + "\n</robot>\n"


def base():
    """Base of 0.5 x 0.4 m with a LiDAR and a camera ahead."""
    yield link("base_link", 20, box("0.5 0.4 0.2"), "0 0 0.15", size=0.4)
    yield link("laser", 0.2, '<cylinder radius="0.04" length="0.05"/>')
    yield joint("laser_mount", "fixed", "base_link", "laser", "0.15 0 0.3")
    yield '<link name="camera_link"/>'
    yield joint("camera_mount", "fixed", "base_link", "camera_link", "0.22 0 0.9", "0 0.6 0")


def wheel(
    name, place, axis="0 1 0", rpy="1.5707963 0 0", parent="base_link", kind="continuous", radius=0.1, limit=None
):
    """Wheel on a joint of its own."""
    yield link(name, 1, f'<cylinder radius="{radius}" length="0.04"/>', rpy=rpy)
    yield joint(f"{name}_joint", kind, parent, name, place, axis=axis, limit=limit)


def wheels():
    """Two wheels of a differential drive."""
    yield from wheel("left_wheel", "0 0.22 0.1")
    yield from wheel("right_wheel", "0 -0.22 0.1")


def caster(name, x, y, trail=-0.04, kind="continuous", limit=None):
    """Swivel with a small wheel; without a trail and with limits it is steered."""
    yield link(f"{name}_fork", 0.3, box("0.03 0.03 0.03"), "0 0 0.02", size=0.03)
    yield joint(f"{name}_swivel", kind, "base_link", f"{name}_fork", f"{x} {y} 0.05", axis="0 0 1", limit=limit)
    yield from wheel(f"{name}_wheel", f"{trail} 0 0", parent=f"{name}_fork", radius=0.05)


def arm(prefix="arm", y=0.0, parent="base_link", joints=6, height=0.25, mass=1.0):
    """Arm of up to seven joints that turn, straight ahead at zero."""
    places = ["0 0 0.1", "0.3 0 0", "0.28 0 0", "0.1 0 0", "0.1 0 0", "0.08 0 0"]
    axes = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0", "0 1 0"]
    lengths = [0.06, 0.3, 0.28, 0.1, 0.1, 0.08, 0.05]
    for k in range(joints):
        name, length = f"{prefix}_{k + 1}", lengths[k]
        place = f"0.1 {y} {height}" if k == 0 else places[k - 1]
        yield link(name, mass, box(f"{length} 0.05 0.05"), f"{length / 2} 0 0")
        yield joint(f"{name}_joint", "revolute", parent, name, place, axis=axes[k], limit=(-2.8, 2.8, 60, 2))
        parent = name


def palm(parent="arm_6", prefix=""):
    """Palm at an arm's tip."""
    yield link(f"{prefix}palm", 0.3, box("0.04 0.12 0.04"), "0.02 0 0")
    yield joint(f"{prefix}palm_mount", "fixed", parent, f"{prefix}palm", "0.08 0 0")


def fingers(parent="palm", kind="prismatic", prefix=""):
    """Two fingers that slide, or turn."""
    axis = "0 {} 0" if kind == "prismatic" else "0 0 {}"
    for name, side in (("left", 1), ("right", -1)):
        yield link(f"{prefix}{name}_finger", 0.05, box("0.08 0.012 0.02"), f"0.08 {0.006 * side} 0", size=0.05)
        yield joint(
            f"{prefix}{name}_finger_joint", kind, parent, f"{prefix}{name}_finger",
            axis=axis.format(side), limit=(0.0, 0.045, 40, 0.1),
        )  # fmt: skip


def head(axis="0 1 0", limits=(-0.5, 1.2), parent="base_link"):
    """Pan and tilt with a camera behind them."""
    yield link("pan", 0.3, box("0.05 0.05 0.05"))
    yield joint("pan_joint", "revolute", parent, "pan", "-0.1 0 1.0", axis="0 0 1", limit=(-1.5, 1.5, 5, 1.5))
    yield link("tilt", 0.3, box("0.05 0.05 0.05"))
    yield joint("tilt_joint", "revolute", "pan", "tilt", "0.03 0 0.05", axis=axis, limit=(*limits, 5, 1.5))
    yield '<link name="head_camera_optical_frame"/>'
    rpy = "-1.5707963 0 -1.5707963"
    yield joint("head_camera", "fixed", "tilt", "head_camera_optical_frame", "0.02 0 0", rpy)


def lift(parent="base_link", child="torso"):
    """Column that slides up."""
    yield link(child, 3, box("0.15 0.15 0.4"), "0 0 0.2")
    yield joint("lift_joint", "prismatic", parent, child, "0 0 0.25", axis="0 0 1", limit=(0.0, 0.4, 500, 0.1))


def telescope():
    """Arm of a lift, four segments that slide, and a wrist that turns, as Stretch has."""
    yield from lift(child="carriage")
    parent = "carriage"
    for k in range(4):
        yield link(f"segment_{k}", 0.4, box("0.04 0.15 0.04"), "0 -0.07 0")
        yield joint(
            f"extend_{k}", "prismatic", parent, f"segment_{k}", "0 -0.02 0", axis="0 -1 0", limit=(0, 0.13, 40, 0.2)
        )
        parent = f"segment_{k}"
    yield link("wrist", 0.2, box("0.05 0.05 0.05"))
    yield joint("wrist_yaw", "revolute", parent, "wrist", "0 -0.16 0", axis="0 0 1", limit=(-1.7, 4.0, 30, 2))


def leg(name, x, y):
    """Hip, thigh and shank, straight down at zero."""
    yield link(f"{name}_hip", 0.5, box("0.06 0.06 0.06"))
    yield joint(
        f"{name}_hip_joint", "revolute", "base_link", f"{name}_hip", f"{x} {y} 0.05", axis="1 0 0", limit=(-1, 1, 50, 5)
    )
    for part, parent, place in (("thigh", "hip", "0 0 0"), ("shank", "thigh", "0 0 -0.2")):
        yield link(f"{name}_{part}", 0.5, box("0.04 0.04 0.2"), "0 0 -0.1")
        yield joint(
            f"{name}_{part}_joint", "revolute", f"{name}_{parent}", f"{name}_{part}", place,
            axis="0 1 0", limit=(-2, 2, 50, 5),
        )  # fmt: skip
