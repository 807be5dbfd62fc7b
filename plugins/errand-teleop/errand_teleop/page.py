"""Page of a robot that is driven by hand: its map, state, cameras, events and stop button."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

from errand_teleop.driver import KEYS, Teleop, read_axis_values
from executive.record.announce import map_message
from executive.record.event_log import compress_picture, plain_values
from executive.run.control import Control
from executive.run.robot_log import RobotLog
from executive.view.feed import Feed
from executive.view.page_control import RefusedError, control_json
from executive.words.knowledge import Knowledge
from plant.worlds.world import World
from skills.api import SkillContext
from skills.grid_map import load_grid_map
from skills.inputs.errors import InputError
from skills.perception.detector.camera_images import turn_upright

MAP: Final = "map"
CONTROL: Final = "control"
CAMERA_PERIOD_S: Final = 0.2
"""Time between two pictures; the cameras take turns."""
_PRESSED: Final = "the stop button is pressed; release it to drive"


class TeleopPage:
    """Content of the page of one robot, and its actions. Call `report` in each period."""

    def __init__(
        self, hands: Teleop, context: SkillContext, feed: Feed, save: Callable[[str | None], str] = lambda name: ""
    ) -> None:
        """`save` saves the pose under a name, or under a free one, and returns a sentence."""
        self._hands, self._context, self._feed, self._save = hands, context, feed, save
        self._log = RobotLog(context.robot.name, replace(context, publish=self._publish))
        names = [camera.source for camera in context.robot.capabilities().cameras]
        self._cameras = [each for each in names if each.startswith(("hand", "front", "head"))] or names
        self._picture_due_s = context.clock.now()
        self._note, self._stopped = "", False
        feed.tell("teleop_keys", {key: axis for key, (axis, _) in KEYS.items()})
        self._press(False)

    def show_map(self, world: World, knowledge: Knowledge) -> None:
        """Shows the world's map."""
        self._publish(MAP, map_message(load_grid_map(world.scan_map_path), knowledge, world=world.name))

    def report(self) -> None:
        """Sends the robot's state and, when they are due, a picture and what the robot does not obey."""
        pose, now_s, note = self._hands.pose(), self._context.clock.now(), self._hands.note
        base, joints_rad = (
            [round(each, 2) + 0.0 for each in numbers]  # the page would show a small negative number as -0.00
            for numbers in ((pose.base.x_m, pose.base.y_m, pose.base.yaw_rad), pose.joints_rad)
        )
        own = {"robot": self._context.robot.name, "note": note, "base": base}
        self._feed.tell("teleop", {**own, "joints_rad": joints_rad, "opening": pose.opening, "now_s": now_s})
        self._log.write()
        if note and note != self._note:
            self._tell("refused", note)
        self._note = note
        if self._cameras and now_s >= self._picture_due_s:
            self._picture_due_s, source = now_s + CAMERA_PERIOD_S, self._cameras[0]
            self._cameras = [*self._cameras[1:], source]
            picture, _ = turn_upright(self._context.robot.image(source, depth=False), ())
            self._feed.tell(f"camera/{source}", compress_picture({"image": picture}, now_s))

    def actions(self) -> Mapping[str, Callable[[Mapping[str, Any]], str]]:
        """Returns the page's actions: held keys and sticks, a saved pose, and the stop button."""
        buttons = {"stop": lambda _: self._press(True), "release": lambda _: self._press(False)}
        return {"teleop": self._ask, "save_pose": self._save_as, **buttons}

    def _ask(self, values: Mapping[str, Any]) -> str:
        if self._stopped:
            raise RefusedError(_PRESSED)
        try:
            self._hands.ask(read_axis_values(values))
        except ValueError as error:
            raise RefusedError(str(error)) from error
        return ""

    def _save_as(self, values: Mapping[str, Any]) -> str:
        name = values.get("name")
        try:
            said = self._save(name if isinstance(name, str) and name else None)
        except InputError as error:
            raise RefusedError(str(error)) from error
        self._tell("pose", said)
        return said

    def _press(self, stopped: bool) -> str:
        """Presses or releases the stop button; while it is pressed, the page drives nothing."""
        self._hands.ask({})
        said = "stopped" if stopped else "stop button released"
        state = {"mode": "stopped", "reason": _PRESSED} if stopped else {"mode": "running"}
        self._feed.tell("control", {**control_json(Control().state), **state})
        if stopped or self._stopped:
            self._tell("stop button", said)
        self._stopped = stopped
        return said

    def _tell(self, what: str, message: str) -> None:
        self._publish(CONTROL, {"t": round(self._context.clock.now(), 6), "what": what, "message": message})

    def _publish(self, topic: str, message: Mapping[str, Any]) -> None:
        self._feed(topic, self._context.clock.now(), plain_values({"robot": self._context.robot.name, **message}))
