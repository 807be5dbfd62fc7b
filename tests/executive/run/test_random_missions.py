"""Random missions over all constructs and nestings: they come to an end, nothing is left over, a seed gives one log."""

import pytest

from skills.files.errors import InputError
from tests.benchmarks.random_missions import ran

MISSIONS, GROUP = 300, 30


@pytest.mark.parametrize("first", range(0, MISSIONS, GROUP))
def test_random_missions(first):
    refused = 0
    for seed in range(first, first + GROUP):
        try:
            one = ran(seed)
        except InputError:
            refused += 1
            continue
        assert not one.wrong, f"seed {seed}"
    assert refused <= GROUP // 5


@pytest.mark.parametrize("seed", range(1000, 1040))
def test_the_same_seed_gives_the_same_log(seed):
    assert ran(seed).log == ran(seed).log
