"""A backend without plant, referee and recorder, for tests of what runs on it."""

from executive.run.visitor import RunEntry
from plant.robots.spot.kind import spot_capabilities
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap, KnownPlace
from skills.testing.robot import ScriptedRobot


class ScriptedBackend:
    """A scripted robot at the origin of an empty world."""

    def __init__(self):
        self.clock = VirtualClock()
        self.robot = ScriptedRobot(self.clock, capabilities=spot_capabilities())
        self.asked = []

    def entry(self, tree, durable):
        return RunEntry(tree, self.robot, KnownPlace(), BlockCostmap())

    def show_live(self):
        return None

    def judge(self, tree, result, *, before=(), since_s=0.0):
        self.asked.append((tree.mission_name, result.outcome))

    notes = ()

    def happened(self):
        return ()

    def visitors(self, control, log):
        return ()

    def work(self):
        return {"calls": len(self.robot.calls)}

    def hurry(self):
        self.asked.append("hurry")

    def leave(self, artifacts, out):
        return None
