"""Mission files with random changes: each is refused in its file and line, or compiles; never a traceback.

    python -m tests.benchmarks.mutated_missions --files 5000 --seed 1

Tells how many were refused and how many compiled, the longest time, how much memory came on top, and what was wrong.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from executive.language import load_parser
from executive.mission.file.overrides import overridden
from executive.mission.file.resolve import for_robot, load_mission, mission_from_file
from executive.mission.knowledge import load_knowledge
from executive.tree.compiler import compile_mission
from executive.tree.registry import installed_skills
from skills.files.errors import InputError
from tests.executive.mission.file.mutations import mutated_files

ROOT = Path(__file__).parents[2]
MOST_S, MOST_MB = 1.0, 300.0


def compiler() -> Callable[[Path], None]:
    """What loads and compiles a file; the world, the skills and the parser are loaded once."""
    flat, skills, parser = load_knowledge(ROOT / "plant/worlds/flat/knowledge.yaml"), installed_skills(), load_parser()

    def compile_path(path: Path) -> None:
        loaded = load_mission(path)
        knowledge = overridden(loaded, flat)
        for part in [for_robot(loaded, name, name) for name in loaded.parts] if loaded.parts else [loaded]:
            mission = mission_from_file(part, parser=parser, knowledge=knowledge)
            compile_mission(mission, knowledge=knowledge, registry=skills)

    return compile_path


def fault(path: Path, compile_path: Callable[[Path], None]) -> tuple[str, str]:
    """How a file ends ("compiles", "refused"), and what is wrong with that."""
    begun = time.process_time()
    try:
        compile_path(path)
        how, wrong = "compiles", ""
    except InputError as error:
        how, wrong = "refused", "; ".join(filter(None, map(_told_badly, (error, *error.others))))
    except Exception:
        how, wrong = "traceback", traceback.format_exc()[-700:]
    spent_s = time.process_time() - begun
    return how, wrong or (f"it takes {spent_s:.1f} s" if spent_s > MOST_S else "")


def _told_badly(error: InputError) -> str:
    """What is wrong with an error."""
    if error.file is None or error.line is None or not error.message:
        return f"no place: {error}"
    lines = error.file.read_bytes().count(b"\n") + 1
    if not 1 <= error.line <= lines:
        return f"line {error.line} of {lines}: {error}"
    return f"too long: {str(error)[:300]}" if len(str(error)) > 2000 else ""


def benchmark(files: int, seed: int, tell: Callable[[str], None]) -> int:
    """Try so many; the number of those with something wrong."""
    compile_path = compiler()
    with tempfile.TemporaryDirectory() as folder:
        good = sorted([*(ROOT / "missions").glob("*.yaml"), ROOT / "tests/executive/mission/file/every_block.yaml"])
        for each in good:
            shutil.copy(each, folder)
        for each in good:
            compile_path(Path(folder) / each.name)
        bad, found, begun, start_mb = 0, Counter[str](), time.perf_counter(), _memory_mb()
        for name, raw in mutated_files(good, files, seed):
            path = Path(folder) / "mission.yaml"
            path.write_bytes(raw)
            how, wrong = fault(path, compile_path)
            found[how] += 1
            if wrong:
                bad += 1
                tell(f"{name}: {wrong}")
    more_mb = _memory_mb() - start_mb
    bad += more_mb > MOST_MB
    spent_s = time.perf_counter() - begun
    tell(f"{files} files in {spent_s:.0f} s: {dict(found)}, {bad} with a defect, {more_mb:.0f} MB more")
    return bad


def _memory_mb() -> float:
    """The memory in use, where the system tells."""
    pages = Path("/proc/self/statm")
    return int(pages.read_text().split()[1]) * 4096 / 1e6 if pages.exists() else 0.0


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    return int(benchmark(options.files, options.seed, lambda text: print(text, flush=True)) > 0)


if __name__ == "__main__":
    sys.exit(main())
