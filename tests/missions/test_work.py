"""A fetch computes no more than its budgets allow: a slower path cannot come in unseen on a fast machine."""

import pytest

from executive.record.history import read_history
from tests.tables import yaml_beside

BUDGETS = yaml_beside(__file__, "test_work.yaml")


@pytest.mark.mission
def test_a_fetch_keeps_its_budgets(recorded):
    out, report, _ = recorded
    work = report["work"]
    logged = [event.data for event in read_history(out / "last").events if event.topic == "work"]
    assert logged == [work]
    assert {name: work.get(name) for name in BUDGETS if work.get(name, 0) > BUDGETS[name]} == {}
    assert set(work) == set(BUDGETS), "a counter has no budget, or a budget no counter"
