"""Topics of the robot itself: the date goes on behind midnight, and questions are answered from the facts."""

from datetime import date

import pytest

from errand_home.facts import Facts, QuizAnswer, Team
from errand_home.topics import OWN_TOPICS, about_people, answer_to, name_in, own_sentence, unknown_fact
from errand_people.looks import Appearance

SPIDER = QuizAnswer(question="How many legs does a spider have", answer="A spider has eight legs")
NORWAY = QuizAnswer(question="What is the capital of Norway", answer="The capital of Norway is Oslo")
TEAM = Team(name="Errand", country="Switzerland", affiliation="the Errand project")
FACTS = Facts(team=TEAM, quiz=(SPIDER, NORWAY))


# topic, time after the first midnight (s), sentence
@pytest.mark.parametrize(
    ("topic", "time_s", "says"),
    [
        ("time", 50_700.0, "It is 14:05"),
        ("time", 86_400.0 + 60.0, "It is 00:01"),
        ("today", 50_700.0, "Today is Thursday, 31 December 2026"),
        ("today", 86_400.0, "Today is Friday, 1 January 2027"),
        ("tomorrow", 0.0, "Tomorrow is Friday, 1 January 2027"),
        ("day of the week", 0.0, "Today is Thursday"),
        ("day of the month", 0.0, "Today is day 31 of December"),
        ("name of the team", 0.0, "Our team is called Errand"),
        ("country of the team", 0.0, "Our team comes from Switzerland"),
        ("affiliation of the team", 0.0, "Our team belongs to the Errand project"),
    ],
)
def test_a_topic_has_a_sentence(topic, time_s, says):
    assert own_sentence(topic, FACTS, "Alice", date(2026, 12, 31), time_s) == says


@pytest.mark.parametrize("topic", OWN_TOPICS)
def test_only_topics_of_the_team_need_its_facts(topic):
    assert ("team" in topic) == bool(unknown_fact(topic, Facts()))


# question, what is known of it
@pytest.mark.parametrize(
    ("question", "known"),
    [
        ("How many legs does a spider have?", SPIDER),
        ("how many legs has a spider", SPIDER),
        ("the capital of norway", NORWAY),
        ("What is the capital of Peru?", None),
        ("What time is it?", "time"),
        ("What day is today?", "today"),
        ("What is your team's name?", "name of the team"),
        ("Who are you?", "yourself"),
        ("Why?", None),
    ],
)
def test_a_question_is_answered_only_where_its_words_are_known(question, known):
    assert answer_to(question, FACTS) == known


def test_a_topic_about_people_names_their_place():
    asked = about_people("number of people wearing red in the dining room")
    assert asked is not None and (asked.place, asked.appearance) == ("dining room", Appearance(clothes_colour="red"))
    named = about_people("name of the person at the night stand")
    assert named is not None and (named.place, named.info) == ("night stand", "name")
    assert about_people("number of drinks in the kitchen") is None


@pytest.mark.parametrize("said", ["Jane", "I am Jane.", "my name is jane", "Jane, of course"])
def test_a_name_is_heard_in_a_sentence(said):
    assert name_in(said, ("Robin", "Jane")) == "Jane"
