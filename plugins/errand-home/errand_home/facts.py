"""Facts that a team writes: itself, answers of a quiz, weights of objects; `facts.yaml` beside the knowledge file."""

from typing import Final

from pydantic import Field

from executive.words.knowledge import Knowledge
from skills.inputs.errors import suggestion
from skills.inputs.schema import Name, Strict, Text, validate
from skills.inputs.yaml_source import read_yaml
from skills.quantities import Mass

FACTS_FILE: Final = "facts.yaml"


class Team(Strict):
    """Team to which the robot belongs."""

    name: Name = Field(description="its name")
    country: Name = Field(description="the country that it comes from")
    affiliation: Name = Field(description="the university, school or company")


class QuizAnswer(Strict):
    """Question of a quiz, and its answer."""

    question: Text = Field(description="as it is asked")
    answer: Text = Field(description="as the robot says it")


class Facts(Strict):
    """Facts of one world. Categories of objects stand in `knowledge.yaml`."""

    team: Team | None = Field(default=None, description="the robot's team")
    quiz: tuple[QuizAnswer, ...] = Field(default=(), description="questions with answers")
    weights: dict[Name, Mass] = Field(default_factory=dict, description="weight of each class of objects, kg")


def facts_of(knowledge: Knowledge) -> Facts:
    """Reads the facts beside a knowledge file; none where there is no such file.

    Raises InputError, with file and line, for a wrong value or an unknown class.
    """
    file = None if knowledge.file is None else knowledge.file.with_name(FACTS_FILE)
    if file is None or not file.is_file():
        return Facts()
    source = read_yaml(file)
    facts = validate(Facts, source)
    for name in facts.weights:
        if name not in knowledge.things:
            what = f"weights.{name}: no class of objects in knowledge.yaml"
            raise source.error(("weights", name), what, suggestion(name, knowledge.things))
    return facts
