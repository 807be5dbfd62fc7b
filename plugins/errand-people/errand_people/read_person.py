"""The read_person skill: tells pose, gesture and colour of clothes of a person nearby."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from errand_people.looking import PeopleLookingSkill
from errand_people.looks import KINDS_NOTE, TRAITS, Trait
from errand_people.meet_person import MeetPerson, MeetPersonInputs, person_text
from skills.api import Cause, ObjectObservation, Part, Succeeded
from skills.navigate.trip_planning import place_text
from skills.quantities import Coordinate
from skills.routine import Routine, SkillFailure


@dataclass(frozen=True)
class ReadPersonInputs:
    """Names of a person and their room, the point (x, y) where they are (None: the nearest one ahead), and traits.

    `area_W` is the outline of a room that the robot does not leave (empty: it may).
    """

    person: str
    place_W: tuple[Coordinate, Coordinate] | None = None
    place: str = ""
    traits: tuple[Trait, ...] = TRAITS
    area_W: tuple[tuple[Coordinate, Coordinate], ...] = ()


class ReadPerson(PeopleLookingSkill[ReadPersonInputs]):
    """Looks at a person, also from other sides, until what was asked for is sure; or says what is not.

    The outputs are the person, each trait as a word (empty if not asked for), and a sentence on those asked for.
    """

    name = "read_person"
    Inputs = ReadPersonInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE, Part.ARM})
    outputs: ClassVar[Mapping[str, type]] = {
        "person": ObjectObservation,
        "pose": str,
        "gesture": str,
        "clothes_colour": str,
        "text": str,
    }
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "there is no new scan, or no camera to look with",
        Cause.PLANNING: "there is no free place to look from, or the arm reaches no viewpoint",
        Cause.EXECUTION: "the robot or the arm did not get there, or the camera shows nothing",
        Cause.POSTCONDITION: "nobody is seen there, or a trait is not sure from any side",
    }
    default_timeout_s = 180.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 1.0, "joints": 0.5, "person": 3.0}

    def run(self, inputs: ReadPersonInputs) -> Routine[Succeeded]:
        """Looks at the person until all traits are sure."""
        who, place_W, self.room_W = person_text(inputs.person), inputs.place_W, inputs.area_W
        if place_W is None:
            meet = MeetPerson(self.context)
            met = yield from self.perform(meet, MeetPersonInputs(inputs.person, None, inputs.place))
            x, y, _ = met.outputs["person"].position_W
            place_W = (x, y)
        seen = yield from self.looked_at(place_W, who, inputs.traits)
        yield from self.stow()
        if seen is None:
            raise SkillFailure(Cause.POSTCONDITION, f"nobody is seen at {place_text(place_W)}")
        shown = seen.appearance.only(inputs.traits)
        outputs: dict[str, object] = {"person": self.observation(seen, inputs.person, inputs.place)}
        outputs |= dict.fromkeys(map(str, TRAITS), "") | {str(trait): value for trait, value in shown.traits().items()}
        unsure = [trait.replace("_", " ") for trait in inputs.traits if trait not in shown.traits()]
        text = f"{who} is {shown.text()}" + (f"; {KINDS_NOTE}" if shown.clothes_colour is not None else "")
        if unsure:
            told = f"; {text}" if shown.traits() else ""
            raise SkillFailure(Cause.POSTCONDITION, f"the {' and '.join(unsure)} of {who} is not sure{told}", outputs)
        return Succeeded(text, {**outputs, "text": text})
