"""Hostile texts for every option and argument of every command: refused in plain words, or accepted."""

import hostile_calls
import pytest

TEXTS = hostile_calls.hostile_texts()
TRIED, STRIDE = 1, 7
"""So many texts are tried for each option, others for the next one; `tests.benchmarks.hostile_options` tries all."""
PLACES = hostile_calls.places()


def some(number):
    return [TEXTS[(number * STRIDE + more * len(TEXTS) // TRIED) % len(TEXTS)] for more in range(TRIED)]


@pytest.mark.parametrize("command", sorted({place.command for place in PLACES}))
def test_no_option_of_a_command_breaks_it(command, tmp_path, monkeypatch):
    hostile_calls.prepare(tmp_path)
    monkeypatch.chdir(tmp_path)
    calls = [
        hostile_calls.arguments(place, text)
        for number, place in enumerate(PLACES)
        if place.command == command
        for text in some(number)
    ]
    assert [(words, wrong) for words in calls if (wrong := hostile_calls.defect(words))] == []


def test_every_command_that_needs_values_is_called_with_good_ones():
    """A call that lacks a value is refused for that, and no other option of it is read."""
    lacking = [
        command
        for command, found in hostile_calls.commands().items()
        for parameter in found.params
        if parameter.required and hostile_calls.typed_name(parameter)[0] not in hostile_calls.GOOD.get(command, {})
    ]
    assert lacking == []
