"""Counters of what a run computes."""

import threading
from types import SimpleNamespace

import numpy as np

from executive.run.work import CountedDetector, Work


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
