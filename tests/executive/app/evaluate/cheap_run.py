"""A run function for tests: it takes no time, and some of them die."""

import os
import signal
import sys
import threading
import time
from pathlib import Path


def square(number):
    return number * number


def slow_square(number):
    time.sleep(0.05)
    return number * number


def square_or_die(item):
    """Dies by SIGKILL the first time that it has a number divisible by 10."""
    number, folder = item
    mark = Path(folder) / str(number)
    if number % 10 == 0 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def always_die(number):
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def never_end(number):
    sys.stdout.write("begun\n")
    sys.stdout.flush()
    threading.Event().wait()


def divide(number):
    return 1 / number
