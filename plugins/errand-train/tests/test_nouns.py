import numpy as np
import pytest

from errand_train.nouns import learn_nouns
from executive.language.nouns import NounKinds, noun_examples
from executive.language.parser import load_parser


@pytest.fixture(scope="module")
def vector_of():
    return load_parser().vector


@pytest.fixture(scope="module")
def kinds(vector_of):
    return learn_nouns(noun_examples(), vector_of)


@pytest.mark.parametrize("noun", ["wok", "sofabed", "mittens", "parsnip", "walnuts", "clarinet", "chisel"])
def test_a_noun_that_is_no_example_may_be_within_reach(vector_of, noun):
    examples = {name: kind for name, kind in noun_examples().items() if name not in (noun, noun.rstrip("s"))}
    kinds = learn_nouns(examples, vector_of)
    assert kinds.kind((noun,), lemma=noun.rstrip("s")).within_reach


@pytest.mark.parametrize("noun", ["sonnet", "geometry", "inflation", "thursday", "belgium", "hostel", "melancholy"])
def test_a_noun_that_is_no_example_may_be_out_of_reach(vector_of, noun):
    examples = {name: kind for name, kind in noun_examples().items() if name != noun}
    kinds = learn_nouns(examples, vector_of)
    assert not kinds.kind((noun,), lemma=noun).within_reach


def test_nouns_outside_the_examples_are_mostly_classified_right(vector_of):
    """Ten-fold cross-validation over all examples: a tenth is judged by what the others teach."""
    rows = sorted(noun_examples().items())
    wrong = {True: 0, False: 0}
    for fold in range(10):
        kinds = learn_nouns({n: k for i, (n, k) in enumerate(rows) if i % 10 != fold}, vector_of)
        for noun, kind in rows[fold::10]:
            found = kinds.kind((noun,), lemma=noun)
            wrong[kind.within_reach] += found is not None and found.within_reach is not kind.within_reach
    reachable = sum(kind.within_reach for _, kind in rows)
    assert wrong[True] / reachable < 0.09
    assert wrong[False] / (len(rows) - reachable) < 0.18


def test_the_stored_weights_are_those_that_the_examples_give(kinds, vector_of):
    stored = NounKinds.load(vector_of).weights
    assert np.allclose(stored, kinds.weights, atol=1e-9), "run: python -m errand_train.nouns"
