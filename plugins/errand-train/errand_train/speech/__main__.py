"""`python -m errand_train.speech`: trains the recogniser for noise, and writes the adapter."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from errand_train.libraries import check_libraries
from skills.inputs.errors import InputError

_BAD_INPUT = 2


def main() -> int:
    """Trains as the arguments say; returns 2 when a library or file is missing."""
    args = _arguments()
    try:
        check_libraries(("torch",))
        from errand_train.speech.course import Course, train
        from errand_train.speech.learning import Lessons

        lessons = Lessons(steps=args.steps)
        train(Course(args.out, args.folder, lessons, args.sentences, args.seed, args.batch))
    except InputError as error:
        sys.stderr.write(f"{error}\n")
        return _BAD_INPUT
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m errand_train.speech", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="the adapter's file (npz)")
    parser.add_argument("--folder", type=Path, default=Path("out/speech-training"), help="keeps what was spoken")
    parser.add_argument("--sentences", type=int, default=4500)
    parser.add_argument("--steps", type=int, default=214)
    parser.add_argument("--batch", type=int, default=12, help="sentences of each step")
    parser.add_argument("--seed", type=int, default=1)
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
