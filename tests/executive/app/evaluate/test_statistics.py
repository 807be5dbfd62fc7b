"""Intervals and tests, against published values."""

import pytest

from executive.app.evaluate.statistics import Rate, fisher, mcnemar


def test_wilson_interval_of_81_of_263_is_that_of_newcombe_1998():
    assert Rate(81, 263).interval() == pytest.approx((0.2553, 0.3662), abs=5e-5)


def test_all_of_ten_leaves_room_below():
    assert Rate(10, 10).interval() == pytest.approx((0.7225, 1.0), abs=5e-5)


def test_mcnemar_counts_only_pairs_that_differ():
    # 8 to 1: 2 * (1 + 9) / 2**9
    assert (mcnemar(8, 1), mcnemar(0, 0)) == (pytest.approx(20 / 512), 1.0)


def test_fisher_of_the_lady_tasting_tea():
    assert fisher(Rate(3, 4), Rate(1, 4)) == pytest.approx(0.4857, abs=1e-4)
