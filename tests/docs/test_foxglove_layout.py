"""The layout for Foxglove shows only topics, and values of topics, that a log has."""

import json

import yaml

from tests.docs.documents import DOCS, ROOT

LAYOUT = json.loads((DOCS / "how-to" / "foxglove-layout.json").read_text(encoding="utf-8"))
TOPICS = yaml.safe_load((ROOT / "executive" / "record" / "schemas.yaml").read_text(encoding="utf-8"))


def panels(layout):
    """The names of the panels that a layout arranges."""
    if isinstance(layout, str):
        return [layout]
    return panels(layout["first"]) + panels(layout["second"])


def test_the_layout_arranges_every_panel_that_it_describes():
    assert sorted(panels(LAYOUT["layout"])) == sorted(LAYOUT["configById"])


def test_the_panels_name_topics_and_values_of_the_log():
    topics = {name for panel in LAYOUT["configById"].values() for name in panel.get("topics", {})}
    topics |= {panel["topicPath"] for panel in LAYOUT["configById"].values() if "topicPath" in panel}
    assert topics - TOPICS.keys() == set()
    shown = [path["value"] for panel in LAYOUT["configById"].values() for path in panel.get("paths", ())]
    assert {value.partition(".")[0] for value in shown} == {"state"}
    assert {value.partition(".")[2] for value in shown} <= set(TOPICS["state"]["number"].split())
