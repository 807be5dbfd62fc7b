"""Questions to the speaker, answers, which are inserted into the sentence to understand it again, and refusals."""

import re
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any, Final

from executive.language.lexicon import unquoted, word_list
from executive.words.mission import QuestionPolicy
from executive.words.task import installed_tasks
from skills.inputs.errors import listing

ALIKE_SOUND: Final = 0.2
_LONG_WORD: Final = re.compile(r"(\S{40})\S{20,}")
_PREPOSITION: Final = r"(?:to|into|onto|in|on|at|from|near|next to|beside|under|behind|here|there)"
_FILLERS: Final = re.compile(
    r"^\W*(?:(?:um|uh|er|well|oh|please|yes|yeah|i mean|i meant|i said|i want|i think|make it|take|it is|it's)"
    r"\b[\s,]*)+(?=\w)|[\s,]+please\W*$",
    re.IGNORECASE,
)
_LEADING: Final = re.compile(rf"^(?:{_PREPOSITION}\s+)?(?:(?:the|a|an|my)\s+)?(?=\w)", re.IGNORECASE)
_THERE: Final = "there"
_ORDINALS: Final = ("first", "second", "third", "fourth", "fifth")


def abilities() -> str:
    """Sentence that says what the robot does, with the tasks of plug-ins."""
    from executive.language.task_sentences import spoken_tasks  # answers alone need no templates

    spoken = spoken_tasks()
    more = [task.ability or task.word for task in installed_tasks().values() if task.ability or task in spoken]
    return f"I can fetch, take, put and find objects, {', '.join(('go to places', *more, 'wait'))} and charge"


class Slot(Enum):
    """Role that the name in question has in a command."""

    THING = "thing"  # which object
    PLACE = "place"  # which place
    PERSON = "person"  # which person
    GOAL = "goal"  # where to; nothing was said of it

    @property
    def noun(self) -> str:
        """Noun for the role, for use in a sentence."""
        return "object" if self is Slot.THING else self.value


@dataclass(frozen=True)
class ClarifyingQuestion:
    """Question that the robot asks before it acts.

    `candidates` are the possible answers (empty: any name), `default` is the likeliest answer. The answer replaces the
    words `heard`; if `heard` is None, the answer is added to the sentence.
    """

    text: str
    slot: Slot
    candidates: tuple[str, ...] = ()
    default: str | None = None
    heard: str | None = None

    def to_json(self) -> dict[str, Any]:
        """Returns the question as JSON values."""
        return {**asdict(self), "slot": self.slot.value, "candidates": list(self.candidates)}


Answerer = Callable[[ClarifyingQuestion], str | None]
"""Function that answers a question, or leaves it open (None)."""


def make_answerer(policy: QuestionPolicy, person: Answerer | None = None) -> Answerer:
    """Returns the function that answers questions by a policy; `person` asks a person (None: nobody can be asked)."""
    if policy is QuestionPolicy.FIRST:
        return lambda question: question.default or next(iter(question.candidates), None)
    if policy is QuestionPolicy.ASK and person is not None:
        return person
    return lambda question: None


def which_question(slot: Slot, heard: str, candidates: tuple[str, ...]) -> ClarifyingQuestion:
    """Question which of several candidates a name stands for."""
    text = f"Which {heard}: {listing(candidates, last='or')}?"
    return ClarifyingQuestion(text, slot, candidates, candidates[0], heard)


def perhaps_question(slot: Slot, heard: str, candidates: tuple[str, ...]) -> ClarifyingQuestion:
    """Question whether an unknown name stands for a known one."""
    quoted = listing((f"'{name}'" for name in candidates), last="or")
    text = f"I know no {slot.noun} '{heard}'; did you mean {quoted}?"
    return ClarifyingQuestion(text, slot, candidates, candidates[0], heard)


def chosen_candidate(question: ClarifyingQuestion, answer: str) -> str | None:
    """Candidate that an answer means: by number, name, a word of the name, or a similar name; None if unclear."""
    words = _FILLERS.sub("", answer.lower()).strip(" ,.!?")
    said = re.sub(r"\s+(?:one|please)$", "", _LEADING.sub("", words)).strip(" ,.!?")
    agreed, named = {*re.findall(r"\w+", answer.lower())} - {"please"}, {*said.split()}
    names = question.candidates
    ways = (
        [name for n, name in enumerate(names, 1) if said in (str(n), *_ORDINALS[n - 1 : n])],
        names if agreed and agreed <= word_list("yes") else (),
        [name for name in names if name.lower() == said],
        [name for name in names if named and named <= {*name.lower().split()}],
        [name for name in names if re.search(rf"\b{re.escape(name.lower())}\b", said)],
        _nearly(question, said),
    )
    return next((found[0] for found in ways if len(found) == 1), None)


def insert_answer(sentence: str, question: ClarifyingQuestion, answer: str) -> str:
    """Inserts the answer into the sentence: the candidate that it means, otherwise the answer's own words."""
    value = chosen_candidate(question, answer) or _FILLERS.sub("", answer).strip(" ,.!?")
    if question.heard is None:
        said = _whereto(value) if question.slot is Slot.GOAL else re.sub(rf"^{_PREPOSITION} ", "", value)
        return f"{sentence.rstrip(' .,!?')} {said}"
    heard, pronouns = question.heard.lower(), word_list("pronouns") | word_list("somebody")
    full = _whereto(value) if heard == _THERE else _definite(value) if heard in pronouns else _LEADING.sub("", value)
    longer = tuple(c.lower() for c in question.candidates if len(c) > len(heard))
    for match in re.finditer(rf"\b{re.escape(heard)}\b", sentence, re.IGNORECASE):
        if not sentence[: match.end()].lower().endswith(longer):  # it is no part of a candidate's whole name
            return f"{sentence[: match.start()]}{full}{sentence[match.end() :]}"
    return sentence


def _nearly(question: ClarifyingQuestion, said: str) -> list[str]:
    """Candidates whose spelling or sound is similar to the answer."""
    from rapidfuzz.distance import OSA

    from executive.language.spelling import sound_distance

    slips = [c for c in question.candidates if len(said) > 2 and OSA.distance(said, c.lower()) <= len(c) // 4]
    near = sorted((sound_distance(said, c), n) for n, c in enumerate(question.candidates))[:1]
    return slips or [question.candidates[n] for distance, n in near if distance <= ALIKE_SOUND]


def _definite(value: str) -> str:
    return value if re.match(r"(?:the|a|an|my|some|that|this|\d+|one|two|three)\b|[A-Z]", value) else f"the {value}"


def _whereto(value: str) -> str:
    return value if re.match(rf"(?:{_PREPOSITION})\b", value, re.IGNORECASE) else f"to {_definite(value)}"


class RefusalKind(Enum):
    """Machine-readable kind of a refusal; the reason is written for people."""

    NOT_UNDERSTOOD = "not_understood"  # words outside the robot's abilities
    NOTHING_TO_DO = "nothing_to_do"  # it asks for no action
    NO_SUCH_DOOR = "no_such_door"
    UNSEEN = "unseen"  # it asks for what no sensor shows
    OTHER = "other"


class RefusalError(Exception):
    """Refusal of a sentence: the reason in one line, and the unknown words.

    `question` is True if an answer from the speaker would help, or is the question itself. `plain` marks the refusal of
    plain words in a sentence with structure.
    """

    plain = False

    def __init__(
        self,
        reason: str,
        unknown: Iterable[str] = (),
        *,
        question: bool | ClarifyingQuestion = False,
        kind: RefusalKind = RefusalKind.OTHER,
    ) -> None:
        self.kind = kind
        self.reason = _LONG_WORD.sub(r"\1…", unquoted(reason))
        super().__init__(self.reason)
        self.unknown = tuple(dict.fromkeys(_LONG_WORD.sub(r"\1…", unquoted(word)) for word in unknown))
        if question is True:
            heard = next(iter(self.unknown), None)
            slot = Slot.GOAL if heard is None else Slot.PLACE if heard == _THERE else Slot.THING
            question = ClarifyingQuestion(f"{self.reason[:1].upper()}{self.reason[1:]}", slot, heard=heard)
        self.question = question or None
