"""A meter on a wall, made of boxes: a dark body, and a number in bright segments."""

import shutil

from plant.worlds.world import WORLDS_FOLDER

BODY_M = (0.04, 0.22, 0.12)
DIGIT_M, WIDTH, PITCH, STROKE = 0.06, 0.55, 0.8, 0.14
"""Height of the digits; their width, the distance from one to the next and the stroke, as shares of the height."""
SEGMENTS = {
    "a": (0.0, WIDTH, 0.0, STROKE),
    "b": (WIDTH - STROKE, WIDTH, 0.0, 0.48),
    "c": (WIDTH - STROKE, WIDTH, 0.52, 1.0),
    "d": (0.0, WIDTH, 1.0 - STROKE, 1.0),
    "e": (0.0, STROKE, 0.52, 1.0),
    "f": (0.0, STROKE, 0.0, 0.48),
    "g": (0.0, WIDTH, 0.5 - STROKE / 2, 0.5 + STROKE / 2),
}
"""Segments of a digit: from and to along its width, and from its top down, as shares of its height."""
LIT = {
    **{"0": "abcdef", "1": "bc", "2": "abged", "3": "abgcd", "4": "fgbc"},
    **{"5": "afgcd", "6": "afgecd", "7": "abc", "8": "abcdefg", "9": "abcdfg"},
}
"""Segments of each digit."""
MIDDLE_W = (0.16, 7.55, 1.0)
"""Middle of the meter's face, on the west wall of the flat's workshop."""
POSE = {"x": 1.3, "y": 7.55, "yaw": 3.1416}

BOX = """<visual name="{name}"><pose>{x:.5f} {y:.5f} {z:.5f} 0 0 0</pose>
<geometry><box><size>{size[0]:.5f} {size[1]:.5f} {size[2]:.5f}</size></box></geometry>
<material><diffuse>{colour}</diffuse></material></visual>
"""
MODEL = """<sdf version="1.9"><model name="meter"><link name="meter">
<collision name="body"><geometry><box><size>{0} {1} {2}</size></box></geometry></collision>
{boxes}</link></model></sdf>
"""
WELD = """- add_model:
    name: meter
    file: package://world/meter.sdf
- add_weld:
    parent: world
    child: meter::meter
    X_PC: {translation: [0.14, 7.55, 1.0]}
"""


def meter_sdf(number, lit=LIT):
    """SDF of a meter that faces x and shows a number; its origin is the middle of its body."""
    boxes = [BOX.format(name="body", x=0, y=0, z=0, size=BODY_M, colour="0.15 0.15 0.17 1")]
    left_m = -DIGIT_M * (PITCH * (len(number) - 1) + WIDTH) / 2
    for place, digit in enumerate(number):
        for segment in lit[digit]:
            low, high, top, bottom = (DIGIT_M * share for share in SEGMENTS[segment])
            boxes.append(
                BOX.format(
                    name=f"{segment}{place}",
                    x=BODY_M[0] / 2,
                    y=left_m + DIGIT_M * PITCH * place + (low + high) / 2,
                    z=DIGIT_M / 2 - (top + bottom) / 2,
                    size=(0.002, high - low, bottom - top),
                    colour="0.4 1.0 0.5 1",
                )
            )
    return MODEL.format(*BODY_M, boxes="".join(boxes))


def write_workshop(folder, number):
    """Writes a world into a new folder: the flat with a meter in the workshop, which the robot knows as a place."""
    shutil.copytree(WORLDS_FOLDER / "flat", folder)
    (folder / "meter.sdf").write_text(meter_sdf(number))
    with (folder / "world.dmd.yaml").open("a") as directives:
        directives.write(WELD)
    place = f"  meter: {{pose: {POSE}, shows: {list(MIDDLE_W)}}}\n".replace("'", "")
    knowledge = (folder / "knowledge.yaml").read_text()
    (folder / "knowledge.yaml").write_text(knowledge.replace("places:\n", f"places:\n{place}", 1))
    return folder
