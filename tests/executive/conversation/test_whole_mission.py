"""Whole mission in the plant, corrected while the robot drives; the referee judges the corrected one."""

import pytest

from executive.app.prepare.from_request import prepare
from executive.app.runs.conversations import conversation_of
from executive.app.runs.one_run import run_request
from executive.mission.request import Request
from executive.run.control import Control
from tests.visitors import OnTick


@pytest.mark.mission
def test_a_corrected_mission_is_fulfilled_as_corrected(tmp_path):
    prepared, control = prepare(Request("go to the kitchen", out=tmp_path, record=False)), Control(pace=None)
    conversation = conversation_of(prepared, control)
    conversation.set_mission(prepared.tree, memory=prepared.meant.memory)
    said = [(1.0, "where are you"), (2.0, "no, to the living room"), (4.0, "wait"), (6.0, "go on")]
    replies = []

    def observe(progress):
        conversation.tick(progress)
        while said and progress.now_s >= said[0][0]:
            replies.append(conversation.hear(said.pop(0)[1]).text)

    finished = run_request(prepared, visitors=[OnTick(observe)], control=control)
    assert replies[0] == "I am in the living room"
    assert finished.report.achieved
    assert finished.report.commands == ("Take [Nothing] to [living room] and do [Nothing] to [Nothing]",)
