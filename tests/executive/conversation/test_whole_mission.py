"""A whole mission in the plant, corrected while the robot drives; the referee judges what was said last."""

import pytest

from executive.cli.durable import Asked
from executive.cli.mission_run import run_request
from executive.cli.talk import LateParser, conversation_of
from executive.run.control import Control


@pytest.mark.mission
def test_a_corrected_mission_is_fulfilled_as_corrected(tmp_path):
    request = Asked(say="go to the kitchen").request()
    tree, control = request.compile(), Control(pace=None)
    conversation = conversation_of(request, control, LateParser())
    conversation.begun(tree, memory=request.meant.memory)
    said = [(1.0, "where are you"), (2.0, "no, to the bathroom"), (4.0, "wait"), (6.0, "go on")]
    replies = []

    def observe(progress):
        conversation.observe(progress)
        while said and progress.now_s >= said[0][0]:
            replies.append(conversation.hear(said.pop(0)[1]).text)

    finished = run_request(request, tree, seed=1, out=tmp_path, record=False, observer=observe, control=control)
    assert replies[0] == "I am in the living room"
    assert finished.report.achieved
    assert finished.report.commands == ("Take [Nothing] to [bathroom] and do [Nothing] to [Nothing]",)
