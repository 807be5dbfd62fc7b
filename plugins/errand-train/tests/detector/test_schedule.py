import numpy as np
import pytest

from errand_train.detector.schedule import Budget, Schedule, shuffled_numbers


def test_the_rate_rises_first_and_falls_to_the_last_share():
    schedule = Schedule(highest_rate=1.0, last_share=0.1, warm_up_steps=10)
    assert schedule.rate(0, 0.0) == pytest.approx(0.1)
    assert schedule.rate(9, 0.0) == pytest.approx(1.0)
    assert schedule.rate(500, 0.5) == pytest.approx(0.55)
    assert schedule.rate(900, 1.0) == pytest.approx(0.1)


def test_windows_come_first_and_whole_pictures_last():
    schedule = Schedule()
    canvases = [schedule.phase(progress).canvas for progress in (0.0, 0.3, 0.7, 1.0)]
    widths = [canvas.width_px for canvas in canvases]
    assert widths == sorted(widths)
    assert not canvases[0].whole
    assert canvases[-1].whole
    assert canvases[-1].mosaic == 0.0


def test_sizes_of_canvases_fit_the_networks_strides():
    phases = [*Schedule().phases, *Schedule.refining().phases]
    assert all(phase.canvas.width_px % 32 == 0 and phase.canvas.height_px % 32 == 0 for phase in phases)


def test_learnt_weights_are_refined_on_what_comes_last_from_nothing():
    last = [phase.canvas for phase in Schedule().phases[-2:]]
    assert [phase.canvas for phase in Schedule.refining(0.002).phases] == last
    assert Schedule.refining(0.002).highest_rate == 0.002


# pictures, seconds of the budget; taken, gone -> share
@pytest.mark.parametrize(
    ("pictures", "seconds", "expected"),
    [(100, None, 0.5), (None, 40.0, 0.25), (100, 12.0, 10 / 12), (None, 5.0, 1.0), (None, None, 1.0)],
)
def test_progress_is_of_whatever_is_limited(pictures, seconds, expected):
    assert Budget(pictures, seconds).progress(50, 10.0) == pytest.approx(expected)


def test_every_round_holds_each_picture_once_wherever_it_is_begun():
    whole = shuffled_numbers(seed=3, first=0, count=21, of=7)
    assert [sorted(whole[k : k + 7].tolist()) for k in (0, 7, 14)] == [list(range(7))] * 3
    assert whole[:7].tolist() != whole[7:14].tolist()
    assert np.array_equal(shuffled_numbers(seed=3, first=5, count=6, of=7), whole[5:11])
    assert not np.array_equal(shuffled_numbers(seed=4, first=0, count=21, of=7), whole)
