"""The table of a robot's commands, which does not grow with the mission."""

import pytest

from skills.command_table import MOST_STATUSES, CommandTable
from skills.robot import CommandCause, CommandId, CommandState


def test_of_many_commands_the_last_are_known_and_the_old_ones_are_over():
    table = CommandTable()
    arm = table.begin("arm", None, 0.0, 1e9)
    ids = [table.begin("drive", None, 0.05 * n, 0.05 * n + 0.5) for n in range(10 * MOST_STATUSES)]
    assert len(table._statuses) <= MOST_STATUSES + 2 and len(set(ids)) == len(ids)
    assert table.status(arm).state is CommandState.RUNNING
    assert [table.status(each).state for each in ids[-2:]] == [CommandState.STOPPED, CommandState.RUNNING]
    assert table.status(ids[0]).reason == "it was over long ago"
    assert {table.status(each).cause for each in (ids[0], ids[-2])} == {CommandCause.STOPPED}
    with pytest.raises(KeyError):
        table.status(CommandId(ids[-1] + 1))
