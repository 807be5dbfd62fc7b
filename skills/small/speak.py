"""The speak skill says a sentence to the people around."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

from skills.api import Cause, Failed, Part, Running, Skill, Step, Succeeded, say
from skills.quantities import Delay

LONGEST_TEXT: Final = 500
"""Largest number of characters."""


@dataclass(frozen=True)
class SpeakInputs:
    """Text to say, 500 characters at most."""

    text: str


@dataclass(frozen=True)
class SpeakOptions:
    """Duration of speech: `word_s` for each word, and at least `at_least_s`."""

    word_s: Delay = 0.35
    at_least_s: Delay = 0.5


class Speak(Skill[SpeakInputs]):
    """Says a text once, and waits as long as saying it takes. Commands no motion.

    The text is published under the topic `speech` when it begins. A viewer of the run says it aloud or shows it; in a
    silent zone, which the message names, it is only shown.
    """

    name: ClassVar[str] = "speak"
    Inputs: ClassVar[type] = SpeakInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.VOICE})
    Options: ClassVar[type] = SpeakOptions
    options: SpeakOptions
    causes: ClassVar[Mapping[Cause, str]] = {Cause.PRECONDITION: "there is no text, or it is too long"}

    _begun_s: float | None = None

    def begin(self, inputs: SpeakInputs) -> None:
        """Says the text, unless it cannot be said."""
        self._text = " ".join(inputs.text.split())
        self._refusal = _refusal(self._text)
        self._begun_s = self.context.clock.now()
        self._lasts_s = max(self.options.at_least_s, self.options.word_s * len(self._text.split()))
        self._silent: str | None = None
        if self._refusal is None:
            self._silent = say(self.context, self._text)
            self._lasts_s = self.options.at_least_s if self._silent else self._lasts_s

    def step(self) -> Step:
        """Waits until the text is said."""
        if self._refusal is not None:
            return self._refusal
        assert self._begun_s is not None
        passed_s = self.context.clock.now() - self._begun_s
        if passed_s < self._lasts_s:
            return Running(f'{"shows" if self._silent else "says"} "{self._text}"', passed_s / self._lasts_s)
        if self._silent:
            return Succeeded(f'showed "{self._text}" without a sound: {self._silent} is a silent zone')
        return Succeeded(f'said "{self._text}"')

    def resume(self, inputs: SpeakInputs) -> None:
        """Says the text again only after a restart, when it is unknown how much of it was heard."""
        if self._begun_s is None:
            self.begin(inputs)


def _refusal(text: str) -> Failed | None:
    """Returns a failure for a text that cannot be said; None otherwise."""
    if not text:
        return Failed(Cause.PRECONDITION, "there is nothing to say")
    if len(text) > LONGEST_TEXT:
        return Failed(Cause.PRECONDITION, f"{len(text)} characters are too many to say; {LONGEST_TEXT} are the most")
    return None
