"""Records what components are given in a fetch in the plant, and their answers; `--update`: the answers alone."""

import sys
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import yaml

from executive.app.prepare.from_request import prepare
from executive.app.runs.one_run import run_request
from executive.mission.request import Request
from executive.run.control import Control
from skills.detect import skill as detect_skill
from skills.estimate.monte_carlo import MonteCarloLocaliser
from skills.manipulation.grasp.planning import GeometricGraspPlanner
from skills.robot import Intrinsics, Pose2D
from tests.skills.replay.stored import save
from tests.skills.replay.test_replay import COMPONENTS, INPUT, REFERENCE, detector
from tests.tables import yaml_beside

SAID, SEED = "Hey Alice, can you fetch me the cylinder from the workshop", 3
SCANS, EVERY_S, COLUMNS, PICTURES = 40, 0.5, 200, 4
LOCALISER, PLANNER = MonteCarloLocaliser, GeometricGraspPlanner
WATCHED = ((LOCALISER, "update"), (detect_skill, "detections_3d"), (PLANNER, "candidates"), (PLANNER, "plan"))


class Recorder:
    """Takes the calls of components, and notes what each is given until the first grasp is planned."""

    def __init__(self):
        self.control, self.scans, self.pictures, names = Control(pace=None), [], [], detector().class_names
        self.given = {"said": SAID, "seed": SEED, "scans": self.scans, "pictures": self.pictures, "class_names": names}

    def update(self, localiser, robot, call=LOCALISER.update):
        if not self.scans:
            self.given |= {"grid": localiser.grid, "start": Pose2D.from_transform(localiser.estimate().X_WO)}
        scan, due_s = robot.scan(), self.scans[-1][0].stamp_s + EVERY_S if self.scans else 0.0
        if scan.stamp_s >= due_s and len(self.scans) < SCANS:
            every = len(scan.azimuths_rad) // COLUMNS
            few = {"ranges_m": scan.ranges_m[:, ::every], "azimuths_rad": scan.azimuths_rad[::every]}
            self.scans.append((replace(scan, **few), robot.odometry()))
        call(localiser, robot)

    def detections_3d(self, image, place, found, surfaces, call=detect_skill.detections_3d):
        """Notes half the pixels of depth."""
        of = Intrinsics(*(type(each)(each / 2) for each in vars(image.depth_intrinsics).values()))
        small = replace(image, grey=image.grey[:0, :0], depth_m=image.depth_m[::2, ::2], depth_intrinsics=of)
        if len(self.pictures) < PICTURES:
            self.pictures.append((small, place, found, surfaces))
        return call(image, place, found, surfaces)

    def candidates(self, planner, target, p_BS, gripper, call=PLANNER.candidates):
        self.target, self.every = {"target": target, "shoulder": p_BS}, call(planner, target, p_BS, gripper)
        return self.every

    def plan(self, planner, scene, q_rad, candidates, around, *others, call=PLANNER.plan):
        state = others[-1].bit_generator.state
        plan = call(planner, scene, q_rad, candidates, around, *others)
        numbers = [self.every.index(each) for each in candidates]
        joints, around = dict(scene._joints_rad), replace(around, others=())
        self.given["grasp"] = {**self.target, "joints": joints, "opening": scene._opening, "start_rad": q_rad}
        self.given["grasp"] |= {"numbers": numbers, "around": around, "random_state": state}
        self.control.cancel("recorded")
        return plan


def record():
    """Writes the input."""
    recorder = Recorder()
    for owner, name in WATCHED:
        patch.object(owner, name, autospec=True, side_effect=getattr(recorder, name)).start()
    with TemporaryDirectory() as folder:
        run_request(prepare(Request(SAID, seed=SEED, out=Path(folder), record=False)), control=recorder.control)
    patch.stopall()
    save(INPUT, recorder.given)


def update():
    """Writes the reference, and yields how many rows of each component changed."""
    before, now = yaml_beside(__file__, REFERENCE.name) if REFERENCE.exists() else {}, {}
    for name, component in ((each.__name__, each) for each in COMPONENTS):
        rows = now[name] = [[word, *(round(float(x), 4) for x in row)] for word, *row in component()]
        changed = sum(row != other for row, other in zip_longest(rows, before.get(name, ())))
        yield f"{name}: {changed} of {len(rows)} rows changed\n"
    REFERENCE.write_text(yaml.safe_dump(now, sort_keys=False, width=160, default_flow_style=None))


if __name__ == "__main__":
    if "--update" not in sys.argv:
        sys.stdout.write(f"'{SAID}' at seed {SEED}\n")
        record()
    sys.stdout.writelines(update())
