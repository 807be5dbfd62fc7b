import pytest

from executive.words.knowledge import load_knowledge
from skills.api import FilterType, Zone, ZoneKind, ZoneMask
from skills.files.errors import InputError

ROOM = ((2.0, 0.0), (4.0, 0.0), (4.0, 2.0), (2.0, 2.0))
WORLD = """\
start: {x: 0.0, y: 0.0}
places:
  bath: {pose: {x: 3.0, y: 1.0}, polygon: [[2, 0], [4, 0], [4, 2], [2, 2]]}
zones:
"""
PARAMETERS = """\
controller_server:
  ros__parameters: {controller_frequency: 20.0}
keepout_filter_info_server:
  ros__parameters: {type: 0, filter_info_topic: k, mask_topic: m, base: 0.0, multiplier: 1.0}
speed_filter_info_server:
  ros__parameters: {type: 2, filter_info_topic: s, mask_topic: m, base: 0.2, multiplier: 0.01}
"""


def zones(tmp_path, text):
    path = tmp_path / "knowledge.yaml"
    path.write_text(f"{WORLD}  wet: {text}\n", encoding="utf-8")
    return load_knowledge(path).known_zones()


@pytest.mark.parametrize(
    ("text", "zone"),
    [
        ("{kind: keep_out, place: bath}", Zone("wet", ZoneKind.KEEP_OUT, ROOM)),
        ("{kind: silent, polygon: [[2, 0], [4, 0], [4, 2], [2, 2]]}", Zone("wet", ZoneKind.SILENT, ROOM)),
        ("{kind: speed_limit, place: bath, share: 0.5}", Zone("wet", ZoneKind.SPEED_LIMIT, ROOM, share=0.5)),
        ("{kind: one_way, place: bath, direction: 1.5}", Zone("wet", ZoneKind.ONE_WAY, ROOM, direction_rad=1.5)),
    ],
)
def test_a_zone_reaches_the_skills_with_its_ground(tmp_path, text, zone):
    assert zones(tmp_path, text) == (zone,)


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("{kind: keep_out, mask: mask.yaml}", (FilterType.KEEP_OUT, 0.0, 1.0)),
        ("{kind: speed_limit, mask: mask.yaml}", (FilterType.SPEED_SHARE, 100.0, -1.0)),
        ("{kind: speed_limit, mask: mask.yaml, info: nav2.yaml}", (FilterType.SPEED, 0.2, 0.01)),
        ("{kind: keep_out, mask: mask.yaml, info: nav2.yaml}", (FilterType.KEEP_OUT, 0.0, 1.0)),
        ("{kind: speed_limit, mask: mask.yaml, info: {type: 2, base: 1.0}}", (FilterType.SPEED, 1.0, 1.0)),
    ],
)
def test_a_mask_is_found_beside_the_file_with_its_filter_info(tmp_path, text, meaning):
    (tmp_path / "mask.yaml").write_text("image: mask.pgm\n", encoding="utf-8")
    (tmp_path / "nav2.yaml").write_text(PARAMETERS, encoding="utf-8")
    (zone,) = zones(tmp_path, text)
    assert zone.mask == ZoneMask(str(tmp_path / "mask.yaml"), *meaning)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{kind: keep_out, place: cellar}", "'cellar' is not known"),
        ("{kind: keep_out, polygon: [[2, 0], [4, 0]]}", "should have 3 parts or more"),
        ("{kind: keep_out}", "give one of 'place', 'polygon' and 'mask'"),
        ("{kind: keep_out, place: bath, speed: 0.3}", "a zone of kind 'keep_out' has no other key beside its ground"),
        ("{kind: speed_limit, place: bath}", "has 'speed' or 'share' beside its ground"),
        ("{kind: one_way, place: bath}", "a zone of kind 'one_way' has 'direction' beside its ground"),
        ("{kind: speed_limit, mask: mask.yaml, speed: 0.3}", "with a mask has no other key"),
        ("{kind: silent, place: bath, info: {type: 0}}", "has no other key"),
        ("{kind: preferred, mask: mask.yaml}", "of kind 'keep_out' or 'speed_limit'"),
        ("{kind: keep_out, mask: gone.yaml}", "there is no file 'gone.yaml' beside knowledge.yaml"),
        ("{kind: keep_out, mask: ../mask.yaml}", "leads out of the folder"),
        ("{kind: keep_out, mask: mask.yaml, info: {type: 1}}", "a filter of type 1 is not of kind 'keep_out'"),
        ("{kind: slippery, place: bath}", "should be 'keep_out', 'preferred', 'speed_limit', 'one_way' or 'silent'"),
    ],
)
def test_a_wrong_zone_is_refused_in_its_line(tmp_path, text, message):
    (tmp_path / "mask.yaml").write_text("image: mask.pgm\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        zones(tmp_path, text)
    assert message in str(caught.value)
    assert (caught.value.file, caught.value.line) == (tmp_path / "knowledge.yaml", 5)
