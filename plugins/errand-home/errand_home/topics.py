"""Topics of commands of *report* and *answer*: topics of the robot itself, and what is asked of people."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from typing import Final

from errand_home.facts import FACTS_FILE, Facts, QuizAnswer
from errand_home.persons import appearance_of
from errand_people.looks import Appearance

DAY_S: Final = 86_400.0
_ABOUT_PEOPLE: Final = re.compile(
    r"(?P<info>name|pose|gesture) of the person (?:in|on|at) the (?P<where>.+)"
    r"|number of (?P<who>.+?) in the (?P<room>[^,]+)",
    re.IGNORECASE,
)
_TEAM: Final = re.compile(r"(?P<key>name|country|affiliation) of the team", re.IGNORECASE)
_TEAM_WORDS: Final = {"name": "is called", "country": "comes from", "affiliation": "belongs to"}
_DATES: Final = ("today", "date", "tomorrow", "day of the week", "day of the month")
OWN_TOPICS: Final = ("time", *_DATES, "yourself", *(f"{key} of the team" for key in _TEAM_WORDS))
_COMMON: Final = frozenset(
    (
        "a",
        "an",
        "the",
        "is",
        "are",
        "was",
        "were",
        "do",
        "does",
        "did",
        "have",
        "has",
        "of",
        "in",
        "on",
        "at",
        "to",
        "for",
        "how",
    )
) | {"which", "what", "who", "many", "your"}
_ENOUGH: Final = 0.75
"""Share of the words of a known question that a question must have."""
_QUESTIONS: Final = (
    (r"\btime\b", "time"),
    (r"\bday is tomorrow\b", "tomorrow"),
    (r"\bday of the week\b", "day of the week"),
    (r"\bday of the month\b", "day of the month"),
    (r"\b(?:date|day is (?:it|today))\b", "today"),
    (r"\bteams? .*(?:country|come from)|\bcountry .*team", "country of the team"),
    (r"\bteams? .*(?:affiliation|university)|\baffiliation .*team", "affiliation of the team"),
    (r"\bname of your team\b|\byour team'?s name\b", "name of the team"),
    (r"\b(?:who are you|about yourself|what can you do|your name)\b", "yourself"),
)
"""Questions about the robot's own topics: a part of the question, and the topic."""


@dataclass(frozen=True)
class AboutPeople:
    """Question about people: a person's `info` at a place, or the number of people of an appearance in a room."""

    place: str
    info: str = ""
    appearance: Appearance | None = None


def about_people(topic: str) -> AboutPeople | None:
    """Parses a topic about people; None for any other topic."""
    found = _ABOUT_PEOPLE.fullmatch(topic)
    if found is None:
        return None
    if found["info"]:
        return AboutPeople(found["where"], found["info"].lower())
    appearance = appearance_of(found["who"])
    return None if appearance is None else AboutPeople(found["room"], appearance=appearance)


def unknown_fact(topic: str, facts: Facts) -> str:
    """Sentence about a fact that a topic needs and that the team has not written; or empty."""
    team = facts.team is None and _TEAM.fullmatch(topic) is not None
    return f"the {topic} is not known; write it under 'team' in {FACTS_FILE}" if team else ""


def own_sentence(topic: str, facts: Facts, robot: str, begun: date, time_s: float) -> str:
    """Sentence about one of `OWN_TOPICS`; the run began on a day, and it is `time_s` after its midnight."""
    days, within_s = divmod(time_s, DAY_S)
    today = begun + timedelta(days=int(days))
    match topic:
        case "time":
            return f"It is {int(within_s // 3600):02d}:{int(within_s % 3600 // 60):02d}"
        case "today" | "date":
            return f"Today is {_day_text(today)}"
        case "tomorrow":
            return f"Tomorrow is {_day_text(today + timedelta(days=1))}"
        case "day of the week":
            return f"Today is {today:%A}"
        case "day of the month":
            return f"Today is day {today.day} of {today:%B}"
    found = _TEAM.fullmatch(topic)
    if found is not None and facts.team is not None:
        key = found["key"].lower()
        return f"Our team {_TEAM_WORDS[key]} {getattr(facts.team, key)}"
    of_team = "" if facts.team is None else f" of the team {facts.team.name}"
    return f"I am {robot}, the robot{of_team}. I find and bring objects, and I follow and guide people"


def _day_text(day: date) -> str:
    return f"{day:%A}, {day.day} {day:%B} {day.year}"


def answer_to(question: str, facts: Facts) -> QuizAnswer | str | None:
    """Known answer to a question, or the own topic that it is about; None when neither is known."""
    asked = _content(question)
    shares = [len(asked & known) / len(known) for each in facts.quiz if (known := _content(each.question))]
    best = max(range(len(shares)), key=shares.__getitem__, default=None)
    if best is not None and shares[best] >= _ENOUGH:
        return facts.quiz[best]
    return next((topic for part, topic in _QUESTIONS if re.search(part, question, re.IGNORECASE)), None)


def _content(question: str) -> frozenset[str]:
    return frozenset(re.findall(r"\w+", question.lower())) - _COMMON


def name_in(said: str, names: Sequence[str]) -> str:
    """Name that somebody says: one of the known names, or else the words without "my name is"."""
    known = next((name for name in names if re.search(rf"\b{re.escape(name)}\b", said, re.IGNORECASE)), None)
    return known or re.sub(r"^(?:i am|i'm|my name is|it is)\s+", "", said.strip(" .!"), flags=re.IGNORECASE)
