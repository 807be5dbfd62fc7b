"""A fetch computes no more than its budgets allow: a slower path cannot come in unseen on a fast machine."""

import pytest

from executive.record.history import read_events

# What this fetch took when the budget was last set, and a fifth more.
BUDGETS = {
    "arm_configuration_checks": 2_070,
    "arm_edge_checks": 11,
    "bytes_logged": 1_170_000,
    "contact_points": 16_700,
    "depth_pictures_160x120": 234,
    "depth_pictures_640x480": 9,
    "detect_class_pictures": 136,
    "detect_in_views_pictures": 6,
    "lidar_rays": 12_900_000,
    "pictures_160x120": 2,
    "pictures_320x240": 136,
    "pictures_40x30": 99,
    "pictures_640x480": 6,
    "planner_expansions": 8_300,
    "plant_steps": 7_380,
    "scan_matches": 894,
}


@pytest.mark.mission
def test_a_fetch_keeps_its_budgets(recorded):
    out, report, _ = recorded
    work = report["work"]
    logged = [event.data for event in read_events(out / "log.mcap") if event.topic == "work"]
    assert logged == [work]
    assert {name: work.get(name) for name in BUDGETS if work.get(name, 0) > BUDGETS[name]} == {}
    assert set(work) == set(BUDGETS), "a counter has no budget, or a budget no counter"
