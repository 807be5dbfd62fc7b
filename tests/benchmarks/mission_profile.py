"""Where one mission's CPU time goes: real-time factor and CPU-seconds by subsystem, before and after the first tick.

    python -m tests.benchmarks.mission_profile [--stacks] [any arguments of `errand run`]

A timer that counts CPU time interrupts the run; each interruption charges what was used since the last one to the
innermost function of this project on the stack. A long call into a library is interrupted at its return, so nothing is
lost and the run is hardly slower. Threads other than the main one are charged to what the main one does meanwhile.
"""

import contextlib
import io
import json
import signal
import sys
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FETCH = ("--say", "Hey Alice, can you fetch me a drink from the kitchen", "--world", "flat", "--seed", "1")
QUIET = ("--no-record", "--quiet", "--json")
PERIOD_S = 0.002
WHOLE = (
    "plant/snapshot",
    "plant/worlds",
    "plant/diagram.py",
    "plant/sensors/camera",
    "plant/scene.py",
    "skills/navigate/people_watch.py",
    "skills/grasp",
)
SUBSYSTEMS = {
    "plant/snapshot": "snapshots",
    "plant/worlds": "parsing the world",
    "plant/diagram.py": "parsing the world",
    "plant/models": "parsing the world",
    "plant/simulation.py": "plant: solver and contact geometry",
    "plant/referee": "referee",
    "plant/sensors/lidar.py": "LiDAR",
    "plant/sensors/ray": "LiDAR",
    "plant/sensors/camera": "pictures",
    "plant/scene.py": "pictures",
    "plant/sensors": "other sensors",
    "plant/spot/sensing.py": "other sensors",
    "plant": "control of base, legs and arm",
    "skills/navigate/people_watch.py": "people watch",
    "skills/detect": "detector",
    "skills/estimate": "localiser and costmap",
    "skills/navigate": "navigation",
    "skills/arm": "arm and grasp planning",
    "skills/grasp": "arm and grasp planning",
    "skills": "other skills",
    "executive/language": "language",
    "executive": "executive",
}


def subsystem(files):
    """The subsystem of a stack, given its files of this project, innermost first."""
    for prefix in WHOLE:
        if any(file.startswith(prefix) for file in files):
            return SUBSYSTEMS.get(prefix) or _of(prefix)
    return _of(files[0]) if files else "imports and libraries"


def _of(file):
    return next((name for prefix, name in SUBSYSTEMS.items() if file.startswith(prefix)), "imports and libraries")


class Profiler:
    """Charges CPU time to (phase, subsystem), and to the innermost functions."""

    def __init__(self):
        self.seconds, self.functions = Counter(), Counter()
        self.phase = "before the first tick"
        self._last_s = time.process_time()
        signal.signal(signal.SIGPROF, self._charge)
        signal.setitimer(signal.ITIMER_PROF, PERIOD_S, PERIOD_S)

    def stop(self):
        signal.setitimer(signal.ITIMER_PROF, 0.0)

    def _charge(self, _signal, frame):
        now_s = time.process_time()
        spent_s, self._last_s = now_s - self._last_s, now_s
        files, functions = [], []
        while frame is not None:
            file = frame.f_code.co_filename
            if file.startswith(str(ROOT)):
                files.append(file[len(str(ROOT)) + 1 :])
                functions.append(f"{files[-1]}:{frame.f_lineno} {frame.f_code.co_name}")
            if frame.f_code.co_name in ("_find_and_load", "_handle_fromlist"):
                files, functions = [], ["imports"]
                break
            frame = frame.f_back
        files = [file for file in files if not file.startswith("tests/benchmarks")]
        self.seconds[self.phase, subsystem(files)] += spent_s
        self.functions[self.phase, " < ".join(functions[:3])] += spent_s


def main(arguments):
    stacks = "--stacks" in arguments
    asked = [each for each in arguments if each != "--stacks"]
    profiler = Profiler()
    from executive.cli.main import main as errand
    from plant.simulation import Engine

    advance = Engine.advance

    def first_advance(self, dt_s):
        Engine.advance = advance
        profiler.phase = "after"
        advance(self, dt_s)

    Engine.advance = first_advance
    sys.argv = ["errand", "run", *(asked or FETCH), *QUIET]
    told = io.StringIO()
    with contextlib.redirect_stdout(told), contextlib.suppress(SystemExit):
        errand()
    profiler.stop()
    report = json.loads(told.getvalue().splitlines()[-1])
    print(_table(profiler, report, stacks=stacks))


def _table(profiler, report, *, stacks):
    phases = ("before the first tick", "after")
    names = sorted({name for _, name in profiler.seconds}, key=lambda name: -profiler.seconds["after", name])
    lines = [f"{'CPU-seconds':40}" + "".join(f"{phase:>24}" for phase in phases)]
    for name in (*names, None):
        cells = [
            sum(spent for (of, what), spent in profiler.seconds.items() if of == phase and name in (what, None))
            for phase in phases
        ]
        lines.append(f"{name or 'all':40}" + "".join(f"{cell:24.2f}" for cell in cells))
    wanted = ("outcome", "sim_time_s", "wall_time_s", "real_time_factor", "ticks", "referee", "work")
    lines.append(json.dumps({key: report[key] for key in wanted if key in report}))
    for phase in phases if stacks else ():
        lines += ["", f"innermost functions, {phase}:"]
        inner = [(spent, what) for (of, what), spent in profiler.functions.most_common() if of == phase]
        lines += [f"{spent:8.2f}  {what}" for spent, what in inner[:45]]
    return "\n".join(lines)


if __name__ == "__main__":
    main(sys.argv[1:])
