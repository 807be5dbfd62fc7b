"""Subtrees of handling things, with the recovery that fits each cause.

| what failed | cause | what is done before the next attempt |
|---|---|---|
| going somewhere | PLANNING, EXECUTION | see anew what stands in the way; back off; another pose nearby |
| finding | not seen | from aside; where such things usually are; other surfaces (`search`) |
| standing before it | PLANNING | see anew what stands around; back off |
| standing before it | others | look again |
| grasping | POSTCONDITION (slipped) | look again, take another grasp |
| grasping | PLANNING | look again; back off and stand anew |
| grasping | PRECONDITION, EXECUTION | look again |
| carrying | the thing was lost | find it on the surfaces near there, pick it up again |
"""

from __future__ import annotations

from typing import Final

from executive.mission.command import Thing
from executive.tree.behaviours.board import BesideBoard, FromBoard, FromBoardOr, beside
from executive.tree.compiling.geometry import inside
from executive.tree.compiling.plans import HoldingPlan, NodePlan, RetryPlan, SelectorPlan, SequencePlan
from executive.tree.compiling.recovery import (
    AfterwardsPlan,
    OnlyIfHoldingPlan,
    PausePlan,
    RecoverPlan,
    RemedyPlan,
    SurfacesNearPlan,
    after,
)
from executive.tree.compiling.search import detect_plan
from executive.tree.compiling.workshop import Workshop
from skills.api import Cause, Surface
from skills.robot import Pose2D

ATTEMPTS: Final = 4
LOOK_AGAIN_S: Final = 0.5
LOST_WITHIN_M: Final = 2.0
NEARBY_M: Final = ((-0.5, 0.0), (0.0, 0.6), (0.0, -0.6))
"""Poses near a goal that will do as well, forward and left of it (m)."""
_NOT_PLANNING: Final = (Cause.PRECONDITION, Cause.EXECUTION, Cause.POSTCONDITION)


def go_near_plan(shop: Workshop, pose: Pose2D | FromBoard) -> NodePlan:
    """Drive to a pose or, when there is no way to it, to one nearby in the same room."""
    direct = shop.navigate(pose)
    others = tuple(
        shop.at(f"nearby-{number}").navigate(other) for number, other in enumerate(_nearby(shop, pose), start=1)
    )
    if not others:
        return direct
    name = "go there or near it"
    return SelectorPlan(path_id=f"{shop.path_id}/or-near", name=name, source=shop.source, steps=(direct, *others))


def _nearby(shop: Workshop, pose: Pose2D | FromBoard) -> list[Pose2D | FromBoard]:
    """Poses beside a goal; those of a known pose lie in the same room."""
    if isinstance(pose, FromBoard):
        return [BesideBoard(pose.key, *offset) for offset in NEARBY_M]
    rooms = [place.polygon for place in shop.knowledge.places.values() if inside(place.polygon, (pose.x_m, pose.y_m))]
    poses = (beside(pose, *offset) for offset in NEARBY_M)
    return [other for other in poses if any(inside(room, (other.x_m, other.y_m)) for room in rooms)]


def pick_up_plan(
    shop: Workshop, thing: Thing, search: NodePlan, key: str, surfaces: tuple[Surface, ...] | FromBoard
) -> NodePlan:
    """Find (`search`, which writes `key`), approach and grasp, with remedies; the arm is tucked in after a failure."""
    near, tried = f"{shop.path_id}/near-sighting", f"{shop.path_id}/tried-grasps"
    approach = shop.skill("approach", {"observation": FromBoard(key), "surfaces": surfaces}, {"observation": near})
    grasp = _grasp_plan(shop, near, tried)
    attempt = shop.at("pick-up").sequence(f"pick up {thing}", search, approach, grasp)
    look = PausePlan(
        path_id=f"{shop.path_id}/look-again", name="look again", source=shop.source, duration_s=LOOK_AGAIN_S
    )
    once_more = PausePlan(
        path_id=f"{shop.path_id}/plan-again", name="look and plan again", source=shop.source, duration_s=LOOK_AGAIN_S
    )
    remedies = (
        RemedyPlan(look, (after(*_NOT_PLANNING, of=grasp), after(*_NOT_PLANNING, of=approach)), uses=2),
        RemedyPlan(once_more, (after(Cause.PLANNING, of=grasp),)),
        RemedyPlan(shop.at("around").skill("clear_costmap"), (after(Cause.PLANNING, of=approach),)),
        RemedyPlan(
            shop.at("around").skill("back_off"),
            (after(Cause.PLANNING, of=grasp), after(Cause.PLANNING, of=approach)),
        ),
    )
    attempts = RecoverPlan(
        path_id=f"{shop.path_id}/attempts",
        name=f"up to {ATTEMPTS} attempts",
        source=shop.source,
        attempt=attempt,
        remedies=remedies,
        attempts=ATTEMPTS,
        forgets=(key, near, tried),
    )
    return tidied(shop.at("tidy"), attempts, only_after_failure=True)


def _grasp_plan(shop: Workshop, near: str, tried: str) -> NodePlan:
    """The grasp, told of those that were tried where the skill can be told."""
    memory = shop.has_ports("grasp", ("avoid",), ("tried",))
    inputs = {"observation": FromBoard(near), **({"avoid": FromBoardOr(tried, ())} if memory else {})}
    return shop.skill("grasp", inputs, {"tried": tried} if memory else {})


def tuck_plan(shop: Workshop) -> NodePlan:
    """Draw the arm in, twice if need be; where that does not work but the thing is held, go on with it."""
    twice = RetryPlan(
        path_id=f"{shop.path_id}/tuck-in",
        name="draw in the arm, twice if need be",
        source=shop.source,
        child=shop.skill("stow"),
        attempts=2,
        causes=frozenset({Cause.PLANNING, Cause.EXECUTION, Cause.POSTCONDITION}),
    )
    below = shop.at("carry-as-it-is")
    settle = PausePlan(
        path_id=f"{below.path_id}/settle", name="hold it still", source=shop.source, duration_s=LOOK_AGAIN_S
    )
    as_it_is = OnlyIfHoldingPlan(path_id=below.path_id, name="carry it as it is held", source=shop.source, child=settle)
    return SelectorPlan(
        path_id=f"{shop.path_id}/tucked-in", name="tuck the arm in", source=shop.source, steps=(twice, as_it_is)
    )


def tidied(shop: Workshop, work: NodePlan, *, only_after_failure: bool = False) -> AfterwardsPlan:
    """Work after which the arm is stowed, whatever came of it."""
    return AfterwardsPlan(
        path_id=shop.path_id,
        name="stow the arm if it fails" if only_after_failure else "stow the arm in the end",
        source=shop.source,
        first=work,
        then=shop.skill("stow"),
        only_after_failure=only_after_failure,
    )


def unless_dropped(shop: Workshop, item: Thing, carry: NodePlan, guards: tuple[HoldingPlan, ...]) -> RecoverPlan:
    """Carrying; when the thing is lost on the way (one of the guards breaks) it is picked up again where it was lost.

    Only surfaces can be looked at: what lies on the floor is not found, and the sentence says so.
    """
    again = _pick_up_again_plan(shop, item)
    return RecoverPlan(
        path_id=shop.path_id,
        name=f"carry {item}",
        source=shop.source,
        attempt=carry,
        remedies=(RemedyPlan(again, tuple(after(Cause.EXECUTION, of=guard, own=True) for guard in guards)),),
        attempts=2,
    )


def _pick_up_again_plan(shop: Workshop, item: Thing) -> SequencePlan:
    below = shop.at("again")
    near, key = f"{below.path_id}/surfaces", f"{below.path_id}/sighting"
    floor = f"the {item} lies on the floor by now, probably, where it cannot be looked for"
    nearby = SurfacesNearPlan(
        path_id=f"{below.path_id}/surfaces-near",
        name="which surfaces are near?",
        source=shop.source,
        surfaces=tuple(map(shop.surface, shop.knowledge.surfaces)),
        within_m=LOST_WITHIN_M,
        key=near,
        otherwise=floor,
    )
    look = SelectorPlan(
        path_id=f"{below.path_id}/find",
        name=f"find {item} near where it was lost",
        source=shop.source,
        steps=(detect_plan(below, item, FromBoard(near), key),),
        exhausted_cause=Cause.POSTCONDITION,
        exhausted_message=floor,
    )
    return SequencePlan(
        path_id=below.path_id,
        name=f"pick {item} up again",
        source=shop.source,
        steps=(
            below.at("first").skill("stow"),
            nearby,
            pick_up_plan(below, item, look, key, FromBoard(near)),
            tuck_plan(below),
        ),
    )
