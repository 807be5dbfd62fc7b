"""Zones of mission files: their two forms, and refusals with line and hint."""

import pytest

from executive.mission.resolve import mission_from_file
from skills.files.errors import InputError
from skills.navigate.zones import ZoneKind


@pytest.fixture
def load(tmp_path, parser, flat):
    """Loads the mission of a text about zones."""

    def load_text(zones, steps="steps:\n- to: kitchen\n"):
        path = tmp_path / "mission.yaml"
        path.write_text(f"name: m\nzones:\n{zones}{steps}", encoding="utf-8")
        return mission_from_file(path, parser=parser, knowledge=flat)

    return load_text


def test_a_list_names_kinds_and_rooms(load):
    zones = load("- keep_out: bathroom\n- {speed_limit: hall, speed: 0.3}\n- silent: bathroom\n").zones
    assert [(name, zone.kind, zone.place, zone.speed) for name, zone in zones.items()] == [
        ("bathroom", ZoneKind.KEEP_OUT, "bathroom", None),
        ("hall", ZoneKind.SPEED_LIMIT, "hall", 0.3),
        ("bathroom, silent", ZoneKind.SILENT, "bathroom", None),
    ]


def test_zones_by_name_have_the_form_of_the_knowledge_file(load):
    (zone,) = load("  wet floor: {kind: keep_out, polygon: [[0, 0], [1, 0], [1, 1]]}\n").zones.values()
    assert zone.polygon == ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))


def test_a_group_has_its_own_zones(load):
    steps = "steps:\n- group:\n  - to: kitchen\n  zones: [{keep_out: Bathroom}]\n"
    (group,) = load("- silent: hall\n", steps).steps
    assert [(name, zone.place) for name, zone in group.zones.items()] == [("Bathroom", "bathroom")]


def test_a_sentence_of_a_file_may_have_a_rule(load):
    (group,) = load("- silent: hall\n", "steps:\n- say: keep out of the bathroom and go to the kitchen\n").steps
    (inner,) = group.steps
    assert [*inner.zones] == ["bathroom"]


@pytest.mark.parametrize(
    ("zones", "words"),
    [
        ("- keep_out: bathrom\n", ":2: unknown room 'bathrom'"),
        ("- keep_out: desk\n", ":2: unknown room 'desk'"),
        ("- speed_limit: hall\n", "'speed' or 'share'"),
        ("- keep_out: [[0, 0], [1, 0], [1, 1]]\n", ":2: zones: a zone of a list is written as its kind with a room"),
        ("- bathroom\n", "a zone of a list is written as its kind with a room"),
        ("- {keep_out: hall, silent: hall}\n", "a zone of a list is written as its kind with a room"),
        ("- {speed_limit: hall, sped: 0.3}\n", "sped"),
        ("  a: {kind: keep_out, mask: mask.yaml}\n", ":3: a zone of a mission has a room or a polygon, and no mask"),
        ("  a: {kind: keep_out, polygon: [[0, 0], [1, 0]]}\n", ":3: "),
    ],
)
def test_a_wrong_zone_is_refused_with_its_line(load, zones, words):
    with pytest.raises(InputError) as caught:
        load(zones)
    assert words in str(caught.value)
