"""People of the plant answer a run's questions, and speak to its robots."""

from types import SimpleNamespace

import pytest

from executive.app.bystanders import Bystanders
from executive.run.control import Control
from executive.run.visitor import Progress
from skills.api import Question

WHO = Question("who", "Are you Robin?", ("yes", "no"), "no", 30.0)


class Stage:
    """A plant of which only the ears and voices are there."""

    def __init__(self, hearer="Robin", answer="yes"):
        self.now_s, self.heard, self.settled = 0.0, [], 0
        self.words = []
        listeners = SimpleNamespace(hearer=lambda robot: hearer, answer=lambda person, text, options: answer)
        walkers = SimpleNamespace(still=False, hear=self.heard.append)
        simulation = SimpleNamespace(listeners=listeners, engine=SimpleNamespace(walkers=walkers))
        self.control = Control()
        self.people = Bystanders(simulation, self, self.control)

    def settle(self):
        self.settled += 1

    def now(self):
        return self.now_s

    def ask(self, question=WHO):
        return self.control.ask(question, self, "Alice")

    def after(self, seconds):
        for _ in range(round(seconds / 0.05)):
            self.now_s += 0.05
            self.people.tick(Progress(self.now_s, 0, 0, {}))


def test_a_person_who_hears_a_question_answers_it_after_a_second():
    stage = Stage()
    asked = stage.ask()
    stage.after(0.9)
    assert not asked.done()
    stage.after(0.3)
    assert asked.done() and asked.result() == "yes" and stage.settled == 1


@pytest.mark.parametrize(("hearer", "answer"), [(None, "yes"), ("Robin", None), ("Robin", "perhaps")])
def test_a_question_without_hearer_or_answer_stays_open(hearer, answer):
    stage = Stage(hearer, answer)
    asked = stage.ask()
    stage.after(3.0)
    assert not asked.done()


def test_a_question_that_is_put_again_is_answered_again():
    stage = Stage()
    for text in ("Are you Robin?", "I did not understand. Are you Robin?"):
        asked = stage.ask(Question("who", text, (), "no", 30.0))
        stage.after(1.2)
        assert asked.done()


def test_people_hear_what_the_robot_says():
    stage = Stage()
    stage.people.message("speech", {"robot": "Alice", "text": "Please follow me."})
    stage.people.message("answer", {"robot": "Alice"})
    assert stage.heard == ["Alice"] and stage.settled == 1


def test_words_of_people_reach_the_skill_that_listens_once():
    stage = Stage()
    first = stage.control.listen("Alice")
    stage.words.append((0.05, "Robin", "thank you"))
    stage.after(0.1)
    second = stage.control.listen("Alice")
    stage.after(0.1)
    assert first.done() and first.result() == "thank you" and not second.done()
