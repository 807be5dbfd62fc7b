"""Zones of mission files: their two forms."""

from skills.world_model import ZoneKind

FILE = "name: m\nzones:\n{}\nsteps:\n{}\n"
GO, QUIET = "- to: kitchen", "- silent: hall"


def test_a_list_names_kinds_and_rooms(load):
    zones = load(FILE.format("- keep_out: bathroom\n- {speed_limit: hall, speed: 0.3}\n- silent: bathroom", GO)).zones
    assert [(name, zone.kind, zone.place, zone.speed) for name, zone in zones.items()] == [
        ("bathroom", ZoneKind.KEEP_OUT, "bathroom", None),
        ("hall", ZoneKind.SPEED_LIMIT, "hall", 0.3),
        ("bathroom, silent", ZoneKind.SILENT, "bathroom", None),
    ]


def test_zones_by_name_have_the_form_of_the_knowledge_file(load):
    mission = load(FILE.format("  wet floor: {kind: keep_out, polygon: [[0, 0], [1, 0], [1, 1]]}", GO))
    assert {name: zone.polygon for name, zone in mission.zones.items()} == {
        "wet floor": ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
    }


def test_a_group_has_its_own_zones(load):
    (group,) = load(FILE.format(QUIET, "- group:\n  - to: kitchen\n  zones: [{keep_out: Bathroom}]")).steps
    assert [(name, zone.place) for name, zone in group.zones.items()] == [("Bathroom", "bathroom")]


def test_a_sentence_of_a_file_may_have_a_rule(load):
    (group,) = load(FILE.format(QUIET, "- say: keep out of the bathroom and go to the kitchen")).steps
    (inner,) = group.steps
    assert [*inner.zones] == ["bathroom"]
