"""Writes `docs/architecture.svg`: the packages, what is in them, and how data flows.

python docs/make_architecture.py
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape

PATH = Path(__file__).resolve().parent / "architecture.svg"
WIDTH, HEIGHT = 1300, 830
INK, PALE = "#1f2933", "#52606d"
FILLS = {
    "executive": "#e6f0fa",
    "skills": "#e9f6ec",
    "plant": "#fbf1e0",
    "cli": "#f1ecf8",
    "app": "#e3ddf3",
    "plug-ins": "#f3f4f6",
}


@dataclass(frozen=True)
class Box:
    """A rounded box with a title and a line of small text."""

    x: int
    y: int
    w: int
    h: int
    title: str
    words: tuple[str, ...] = ()

    @property
    def left(self) -> tuple[int, int]:
        """Middle of the left side."""
        return self.x, self.y + self.h // 2

    @property
    def right(self) -> tuple[int, int]:
        """Middle of the right side."""
        return self.x + self.w, self.y + self.h // 2

    @property
    def top(self) -> tuple[int, int]:
        """Middle of the upper side."""
        return self.x + self.w // 2, self.y

    @property
    def bottom(self) -> tuple[int, int]:
        """Middle of the lower side."""
        return self.x + self.w // 2, self.y + self.h


ROW, LOWER = 70, 182
UNDERSTAND = Box(40, ROW, 150, 70, "language", ("sentence to commands",))
MISSION = Box(230, ROW, 150, 70, "mission", ("YAML, checked",))
COMPILE = Box(420, ROW, 150, 70, "tree: plans", ("node specs, plain data",))
TREE = Box(610, ROW, 150, 70, "tree: nodes", ("guards, recovery", "and skill leaves"))
RUN = Box(800, ROW, 150, 70, "run", ("time, ticks, leases;", "visitors watch"))
WORDS = Box(135, LOWER, 150, 60, "words", ("commands, knowledge,", "steps, goals: data"))
STORE = Box(325, LOWER, 150, 60, "store", ("queue and resume",))
RECORD = Box(515, LOWER, 150, 60, "record", ("log.mcap",))
VIEW = Box(705, LOWER, 245, 60, "view, conversation", ("text, SVG, page; pause, step, ask",))
SKILL = Box(40, 350, 340, 80, "skills, one page or folder each", ("navigate, detect, approach, grasp, place, hand_over,", "stow, relocalise, ... and skills of other packages"))  # fmt: skip  # noqa: E501
ESTIMATE = Box(420, 350, 200, 80, "estimate", ("localiser, costmap:", "immutable snapshots"))
PROTOCOL = Box(660, 350, 290, 80, "robot.py: the Robot protocol", ("know, sense, act, own a lease;", "every motion expires"))  # fmt: skip  # noqa: E501
SPOT = Box(660, 540, 290, 80, "spot, sensors, locomotion", ("servos; noisy LiDAR, cameras, odometry", "in a Drake Diagram"))  # fmt: skip  # noqa: E501
WORLDS = Box(420, 540, 200, 80, "worlds, models", ("rooms, furniture, objects,", "people; placed by the seed"))
REFEREE = Box(40, 540, 340, 80, "referee", ("knows the truth and judges afterwards;", "nobody else may ask it"))
APP = Box(1010, ROW, 130, 550, "app", ("the application:", "one request,", "prepared for", "its robots;", "one loop of runs;", "dispatch, report,", "evaluate", "", "puts all three", "together"))  # fmt: skip  # noqa: E501
CLI = Box(1160, ROW, 120, 550, "cli", ("commands,", "options, output", "", "parse, check,", "tree, run,", "queue, resume,", "log, replay,", "evaluate"))  # fmt: skip  # noqa: E501
PLUGINS = (
    Box(40, 716, 200, 80, "errand-spot", ("serves Spot's API in simulation;", "drives a real Spot: a backend")),
    Box(255, 716, 250, 80, "errand-make", ("objects, worlds and robots of your own;", "maps that the robot makes")),
    Box(520, 716, 212, 80, "errand-train", ("data sets, training, makers of the", "shipped models and worlds")),
    Box(747, 716, 110, 80, "errand-ros2", ("writes logs", "as ROS 2 bags")),
    Box(872, 716, 130, 80, "errand-teleop", ("a robot driven", "by hand")),
    Box(1017, 716, 243, 80, "yours", ("commands, backends, skills, robots,", "components, classes, doors, triggers")),
)
WALL = "plug-ins: import the core's public names; the core imports none, and finds them by entry points"
TALL = (APP, CLI)


def area(kind: str, y: int, height: int, title: str, width: int = 955) -> str:
    """The ground of a package."""
    return (
        f'<rect x="20" y="{y}" width="{width}" height="{height}" rx="12" fill="{FILLS[kind]}"/>'
        f'<text x="36" y="{y + 26}" font-size="18" font-weight="bold" fill="{INK}">{escape(title)}</text>'
    )


def drawn(box: Box, fill: str = "#ffffff") -> str:
    """A box with its words."""
    middle, lines = box.x + box.w // 2, box.words
    first = box.y + 26 if box in TALL else box.y + box.h // 2 - 8 * len(lines) + 4
    bold = 'font-size="15" font-weight="bold" text-anchor="middle"'
    text = f'<text x="{middle}" y="{first}" {bold}>{escape(box.title)}</text>'
    for number, line in enumerate(lines, start=1):
        at = first + 18 * number + (4 if box in TALL else 0)
        text += f'<text x="{middle}" y="{at}" font-size="12" text-anchor="middle" fill="{PALE}">{escape(line)}</text>'
    outline = f'<rect x="{box.x}" y="{box.y}" width="{box.w}" height="{box.h}" rx="8" fill="{fill}" stroke="{PALE}"/>'
    return outline + text


def arrow(start: tuple[int, int], end: tuple[int, int], words: str = "", *, both: bool = False) -> str:
    """An arrow, with a word beside its middle."""
    (x0, y0), (x1, y1) = start, end
    ends = 'marker-end="url(#tip)"' + (' marker-start="url(#tip)"' if both else "")
    line = f'<line x1="{x0}" y1="{y0}" x2="{x1}" y2="{y1}" stroke="{INK}" stroke-width="1.6" {ends}/>'
    side = (
        f'<text x="{(x0 + x1) // 2 + 10}" y="{(y0 + y1) // 2 + 4}" font-size="12" fill="{PALE}">{escape(words)}</text>'
    )
    return line + (side if words else "")


def bent(points: tuple[tuple[int, int], ...], words: str) -> str:
    """An arrow around corners, with a word at its second corner."""
    way = " ".join(f"{x},{y}" for x, y in points)
    line = f'<polyline points="{way}" fill="none" stroke="{INK}" stroke-width="1.6" marker-end="url(#tip)"/>'
    (x, y) = points[2]
    return line + f'<text x="{x + 12}" y="{y + 15}" font-size="12" fill="{PALE}">{escape(words)}</text>'


def svg() -> str:
    """The whole picture."""
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        f'font-family="DejaVu Sans, Helvetica, Arial, sans-serif" fill="{INK}">',
        "<title>Errand's packages and how data flows</title>",
        '<defs><marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" '
        f'orient="auto-start-reverse"><path d="M0,0 L10,5 L0,10 z" fill="{INK}"/></marker></defs>',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#ffffff"/>',
        area("executive", 20, 240, "executive"),
        area("skills", 305, 145, "skills"),
        area("plant", 495, 145, "plant"),
        *map(drawn, (UNDERSTAND, MISSION, COMPILE, TREE, RUN, WORDS, STORE, RECORD, VIEW)),
        *map(drawn, (SKILL, ESTIMATE, PROTOCOL, SPOT, WORLDS, REFEREE)),
        drawn(APP, FILLS["app"]),
        drawn(CLI, FILLS["cli"]),
        area("plug-ins", 670, 145, WALL, 1260),
        *map(drawn, PLUGINS),
        arrow(CLI.left, APP.right),
        *(arrow(a.right, b.left) for a, b in ((UNDERSTAND, MISSION), (MISSION, COMPILE), (COMPILE, TREE))),
        arrow(RUN.left, TREE.right),
        arrow((175, LOWER), (150, ROW + 70)),
        arrow((240, LOWER), (260, ROW + 70)),
        arrow((845, ROW + 70), (640, LOWER)),
        arrow((875, ROW + 70), (875, LOWER), both=True),
        arrow((810, ROW + 70), (450, LOWER)),
        bent(((685, ROW + 70), (685, 283), (210, 283), (210, 350)), "begin, step, end"),
        arrow(ESTIMATE.left, SKILL.right),
        arrow(PROTOCOL.left, ESTIMATE.right),
        bent(((210, 430), (210, 441), (720, 441), (720, 430)), ""),
        *(arrow((1010, y), (976, y)) for y in (140, 378, 568)),
        arrow(PROTOCOL.bottom, SPOT.top, "verbs down, sensors up", both=True),
        arrow(WORLDS.right, SPOT.left),
        arrow(WORLDS.left, REFEREE.right),
        "</svg>",
    ]
    return "\n".join(part for part in parts) + "\n"


if __name__ == "__main__":
    PATH.write_text(svg(), encoding="utf-8")
