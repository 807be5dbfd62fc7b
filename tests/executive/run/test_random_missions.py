"""Random missions over all constructs and nestings: they come to an end, nothing is left over, a seed gives one log."""

import contextlib

import pytest

from skills.inputs.errors import InputError
from tests.benchmarks.random_missions import claimed, ran

MISSIONS, CLAIMS, GROUP = 300, 60, 20
LYING = (63, 97)
NIGHTLY = pytest.mark.nightly


def mostly_nightly(cases, kept):
    """The cases as parameters, of which only the first few are no nightly ones."""
    return [pytest.param(case, marks=[NIGHTLY] * (n >= kept)) for n, case in enumerate(cases)]


@pytest.mark.parametrize("first", mostly_nightly(range(0, MISSIONS, GROUP), 2))
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


@pytest.mark.parametrize("seed", mostly_nightly(range(1000, 1040), 4))
def test_the_same_seed_gives_the_same_log(seed):
    assert ran(seed).log == ran(seed).log


@pytest.mark.parametrize("first", mostly_nightly(range(0, CLAIMS, GROUP), 1))
def test_claim_and_verdict_differ_only_where_a_skill_lied(first):
    for seed in range(first, first + GROUP):
        with contextlib.suppress(InputError):
            assert not claimed(seed).wrong, f"seed {seed}"


def test_lies_that_matter_are_among_the_random_missions():
    """Seeds whose skills lie so that the claim is denied, and one whose lie does not matter."""
    assert [(one.claim, one.verdict, bool(one.lies)) for one in map(claimed, LYING)] == [(True, False, True)] * 2
