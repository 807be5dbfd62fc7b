"""Small leaves that need no skill."""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.behaviours.context import RunContext
from executive.behaviours.explained import Explained
from skills.api import Cause


class RememberPose(Explained, Behaviour):
    """Writes the robot's present pose in the world to the blackboard. Always SUCCESS once the robot is localised.

    FAILURE with PRECONDITION when the robot does not know where it is for longer than `patience_s`.
    """

    def __init__(self, *, path_id: str, name: str, key: str, context: RunContext, patience_s: float = 5.0) -> None:
        super().__init__(name)
        self.path_id = path_id
        self._key, self._context, self._patience_s, self._started_s = key, context, patience_s, 0.0
        self.clear_explanation()

    def initialise(self) -> None:
        """Start the patience."""
        self.clear_explanation()
        self._started_s = self._context.clock.now()

    def update(self) -> Status:
        """Write the pose, or wait for one."""
        if self._context.localiser.estimate().localised:
            pose = self._context.for_skill(self.path_id).pose()
            self._context.board.put(self._key, pose)
            self.message = f"stands at ({pose.x_m:.2f}, {pose.y_m:.2f}) m"
            return Status.SUCCESS
        if self._context.clock.now() - self._started_s <= self._patience_s:
            self.message = "waits until it knows where it is"
            return Status.RUNNING
        self.cause, self.message = Cause.PRECONDITION, "the robot does not know where it is"
        return Status.FAILURE


class Known(Explained, Behaviour):
    """SUCCESS when the blackboard holds the key, else FAILURE with PRECONDITION."""

    def __init__(self, *, path_id: str, name: str, key: str, missing: str, context: RunContext) -> None:
        super().__init__(name)
        self.path_id = path_id
        self._key, self._missing, self._context = key, missing, context
        self.clear_explanation()

    def update(self) -> Status:
        """Look for the key."""
        known = self._key in self._context.board
        self.cause, self.message = (None, "known") if known else (Cause.PRECONDITION, self._missing)
        return Status.SUCCESS if known else Status.FAILURE
