"""People of the plant in a run: they hear the robots, answer their questions, and speak to them."""

from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Final

from executive.record.schemas import SPEECH
from executive.run.control import Control
from executive.run.control_state import OpenQuestion
from executive.run.visitor import Progress, RunVisitor
from plant.engine import Pipeline
from plant.simulation import Simulation

ANSWERS_AFTER_S: Final = 1.0
"""Time between a question and its answer, on the robots' clock."""


class Bystanders(RunVisitor):
    """People near the robots of a simulated run. A question that nobody hears stays open."""

    def __init__(self, simulation: Simulation, pipeline: Pipeline, control: Control) -> None:
        """`control` gets the answers and remarks; the `pipeline` steps the simulation."""
        self._simulation, self._pipeline, self._control = simulation, pipeline, control
        self._heard: dict[tuple[str, str, float], tuple[float, str | None]] = {}
        self._told = len(pipeline.words)

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Lets the people near a robot hear what it says."""
        if topic == SPEECH and not self._simulation.engine.walkers.still:
            self._pipeline.settle()
            self._simulation.engine.walkers.hear(str(message["robot"]))
        return message

    def tick(self, progress: Progress) -> None:
        """Passes on what people say, and their answers to open questions."""
        words = self._pipeline.words
        for _, _, said in words[self._told :]:
            self._control.tell(said)
        self._told = len(words)
        for each in self._control.state.questions:
            self._hear(each, progress.now_s)

    def _hear(self, each: OpenQuestion, now_s: float) -> None:
        """Notes who hears a new question; later passes on their answer, if it is one."""
        key, question = (each.id, each.question.text, each.until_s), each.question
        if key not in self._heard:
            self._pipeline.settle()
            self._heard[key] = (now_s, self._simulation.listeners.hearer(each.robot) if each.robot else None)
        since_s, person = self._heard[key]
        if person is None or now_s < since_s + ANSWERS_AFTER_S - 1e-6:
            return
        self._heard[key] = (since_s, None)
        answer = self._simulation.listeners.answer(person, question.text, question.options)
        if answer is not None:
            with suppress(ValueError):  # the answer is none of the options
                self._control.answer(each.id, answer)
