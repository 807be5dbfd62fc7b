"""Counters of what a run computes, and CPU time by subsystem."""

import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from executive.record.work import OTHER, START, CountedDetector, Profile, Work, lines


def busy(seconds):
    end_s = time.thread_time() + seconds
    while time.thread_time() < end_s:
        pass


def test_counts_of_threads_add_up_and_come_in_the_order_of_names():
    work = Work()
    threads = [threading.Thread(target=lambda: [work.count("expansions") for _ in range(500)]) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    work.count("bytes", 7)
    work.count("steps", 0)
    assert list(work.totals().items()) == [("bytes", 7), ("expansions", 2000)]


def test_a_detectors_pictures_are_counted_by_method():
    detector = SimpleNamespace(class_names=("cup",), detect=lambda pictures: [()] * len(pictures))
    work = Work()
    counted = CountedDetector(detector, work)
    grey = np.zeros((4, 4), np.uint8)
    assert (counted.class_names, counted.detect([grey, grey])) == (("cup",), [(), ()])
    assert dict(work.totals()) == {"detect_pictures": 2}
    assert (counted.detect_class([grey, grey, grey], "cup"), counted.detect_in_views(grey)) == ([(), (), ()], ())
    assert dict(work.totals()) == {
        "detect_class_pictures": 3,
        "detect_in_views_pictures": 1,
        "detect_pictures": 2,
    }


def test_a_second_counts_once_for_the_innermost_call():
    profile = Profile()
    inner = profile.timed("detector", lambda: busy(0.05))
    outer = profile.timed("executive", lambda: (busy(0.03), inner(), inner()))
    profile.begin()
    outer()
    spent = profile.table()
    assert spent["detector"] == pytest.approx(0.1, abs=0.02)
    assert (spent["executive"], list(spent)[-2:]) == (pytest.approx(0.03, abs=0.02), [OTHER, START])
    assert lines(spent)[1].startswith("detector")


def test_attached_methods_are_timed_and_threads_have_their_own_calls():
    profile, owner = Profile(), SimpleNamespace(advance=lambda seconds: busy(seconds))
    profile.attach("plant", owner, "advance")
    job = threading.Thread(target=profile.timed("planning", lambda: busy(0.05)))

    def run():
        job.start()
        owner.advance(0.05)
        job.join()

    profile.timed("executive", run)()
    spent = profile.table()
    assert (spent["plant"], spent["planning"]) == (pytest.approx(0.05, abs=0.02), pytest.approx(0.05, abs=0.02))
    assert spent["executive"] < 0.03
