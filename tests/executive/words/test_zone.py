from pathlib import Path

import pytest

from executive.words.knowledge import load_knowledge
from skills.api import FilterType, Zone, ZoneKind, ZoneMask
from skills.inputs.errors import InputError
from tests.tables import table

ROOM = ((2.0, 0.0), (4.0, 0.0), (4.0, 2.0), (2.0, 2.0))
WORLD = """\
start: {x: 0.0, y: 0.0}
places:
  bath: {pose: {x: 3.0, y: 1.0}, polygon: [[2, 0], [4, 0], [4, 2], [2, 2]]}
zones:
"""
PARAMETERS = Path(__file__).with_name("test_zone_nav2.yaml").read_text(encoding="utf-8")


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


@pytest.mark.parametrize(*table(__file__, "masks"))
def test_a_mask_is_found_beside_the_file_with_its_filter_info(tmp_path, text, meaning):
    (tmp_path / "mask.yaml").write_text("image: mask.pgm\n", encoding="utf-8")
    (tmp_path / "nav2.yaml").write_text(PARAMETERS, encoding="utf-8")
    (zone,) = zones(tmp_path, text)
    kind, base, multiplier = meaning
    assert zone.mask == ZoneMask(str(tmp_path / "mask.yaml"), FilterType[kind], base, multiplier)


@pytest.mark.parametrize(*table(__file__, "wrong_zones"))
def test_a_wrong_zone_is_refused_in_its_line(tmp_path, text, message):
    (tmp_path / "mask.yaml").write_text("image: mask.pgm\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        zones(tmp_path, text)
    assert message in str(caught.value)
    assert (caught.value.file, caught.value.line) == (tmp_path / "knowledge.yaml", 5)
