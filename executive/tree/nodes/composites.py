"""Composites with memory, and their plans: sequence, selector, round, alternatives, and parallel steps.

The results of finished children stay visible.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from typing import ClassVar, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.mission.gripper import held_after_either
from executive.tree.assembly import Assembler, StepPlans, words_of
from executive.tree.behaviour import MemoryComposite, applies, cause_of, failed_for_good, message_of
from executive.tree.board import Board
from executive.tree.estimate import Estimate, Walk
from executive.tree.node import NodeSpec
from executive.tree.nodes.decision_nodes import decide_plan
from executive.tree.nodes.policies import FINAL_CAUSES
from executive.tree.nodes.search import looked
from executive.tree.plan import Assembled, PlanBuilder
from executive.words import steps as model
from executive.words.expression import Value
from skills.api import Cause, Part
from skills.inputs.errors import InputError

_MERELY_NOT_SO = frozenset({Cause.PRECONDITION, Cause.POSTCONDITION})
_NOR: Final = ", nor "


class MemorySequence(MemoryComposite):
    """Sequence with memory.

    | child | status |
    |---|---|
    | RUNNING | RUNNING |
    | SUCCESS | ticks the next child in the same tick; SUCCESS after the last |
    | FAILURE | FAILURE with its cause; later children stay idle |
    | halted | INVALID with CANCELLED |
    """

    kind = "sequence"
    control = "Sequence"
    container = True


class MemorySelector(MemoryComposite):
    """Selector with memory.

    | child | status |
    |---|---|
    | does not apply (`Conditional`) | passed over: the child stays idle, the next one is ticked |
    | RUNNING | RUNNING |
    | SUCCESS | SUCCESS |
    | FAILURE | ticks the next child in the same tick; FAILURE after the last |
    | halted | INVALID with CANCELLED |

    The failure has the messages of all children that could begin, the decisive messages first. Its cause is ERROR if a
    child failed with ERROR, else the first cause that is neither PRECONDITION nor POSTCONDITION, else `exhausted_cause`
    if given, else the cause of the last child, or PRECONDITION if no child applied. Children behind the first `needed`
    are an extra, and only their ERROR counts. With `one_goal` all children lead to the same goal: after a final failure
    of one child, the others are skipped. `looks` has the path ids of the looks at each place: where none of a place was
    taken, the message says that the robot could not look there, and names the others.
    """

    kind = "selector"
    control = "Fallback"
    container = True
    goes_on_after: ClassVar[tuple[Status, ...]] = (Status.FAILURE, Status.INVALID)
    exhausted_cause: Cause | None = None
    exhausted_message: str = ""
    looks: Mapping[str, Sequence[str]] = field(default_factory=dict)
    missed: str = ""
    sought: str = ""
    one_goal: bool = False
    needed: int | None = None

    @classmethod
    def usual_children(cls, node: NodeSpec) -> tuple[NodeSpec, ...]:
        """Returns the branches that do not require a known object."""
        return tuple(child for child in node.children if child.options.get("known_as") is None)

    @classmethod
    def estimate(cls, node: NodeSpec, walk: Walk, first: bool) -> Estimate:
        """Estimates the first possible branch."""
        return walk.possible(node)

    def _passes_over(self, child: Behaviour) -> bool:
        if self.one_goal and child.status != Status.RUNNING and any(map(failed_for_good, self.children)):
            return True
        return child.status != Status.RUNNING and not applies(child)

    def _explanation(self, child: Behaviour) -> tuple[Cause, str]:
        failed = [one for one in self.children if one.status == Status.FAILURE]
        if not failed:
            return self.exhausted_cause or Cause.PRECONDITION, self._summary() or "nothing of it applies"
        causes, needed = [cause_of(one) for one in failed], self.children[: self.needed]
        obstacles = [cause_of(one) for one in failed if one in needed and cause_of(one) not in _MERELY_NOT_SO]
        cause = Cause.ERROR if Cause.ERROR in causes else next(iter(obstacles), self.exhausted_cause or causes[-1])
        tried = [one for one in failed if cause_of(one) is not Cause.PRECONDITION] or failed
        tried.sort(key=lambda one: cause_of(one) is not cause)
        sentences = list(dict.fromkeys(map(message_of, tried)))
        more = f"; and {len(sentences) - 4} more" if len(sentences) > 4 else ""
        shown = f"{'; '.join(sentences[:4])}{more}"
        return cause, ": ".join(filter(None, (self._summary(), shown)))

    def _summary(self) -> str:
        seen = [place for place, leaves in self.looks.items() if looked(self, leaves)]
        unseen = [place for place in self.looks if place not in seen]
        if not unseen:
            return self.exhausted_message
        text = f"{self.missed} {_NOR.join(seen)}; could not look" if seen else f"could not look for {self.sought}"
        return f"{text} {_NOR.join(unseen)}"


class MemoryRound(MemorySelector):
    """Composite that ticks all children, one after the other, whatever their results.

    | child | status |
    |---|---|
    | does not apply (`Conditional`) | passed over |
    | RUNNING | RUNNING |
    | SUCCESS, FAILURE | ticks the next child in the same tick |
    | after the last, with any SUCCESS | SUCCESS with the messages of all that succeeded |
    | after the last, without | FAILURE like a selector |
    | halted | INVALID with CANCELLED |
    """

    kind = "round"
    control = ""
    container = False
    goes_on_after = (Status.SUCCESS, Status.FAILURE, Status.INVALID)

    @classmethod
    def estimate(cls, node: NodeSpec, walk: Walk, first: bool) -> Estimate:
        """Estimates all possible branches."""
        return walk.possible(node, most=None)

    def _take_over(self, child: Behaviour) -> None:
        done = [one for one in self.children if one.status == Status.SUCCESS]
        if child.status == Status.RUNNING or not done:
            super()._take_over(child)
            return
        super()._take_over(done[-1])
        self.message = "; ".join(dict.fromkeys(map(message_of, done)))


class Choose(MemoryComposite):
    """Composite of a decision (first child, which writes its answer under `key`) and one branch for each answer.

    `branches` has the index of the child for each answer.

    | decision | branch | status |
    |---|---|---|
    | RUNNING | idle | RUNNING |
    | FAILURE | idle | FAILURE with its cause |
    | SUCCESS, answer without a branch | - | SUCCESS |
    | SUCCESS, answer with a branch | ticked in the same tick | as the branch |
    | halted, or its branch is halted | halted | INVALID with CANCELLED |
    """

    kind = "choose"
    spoken = True
    branches: Mapping[Value, int]
    key: str
    board: Board

    @classmethod
    def estimate(cls, node: NodeSpec, walk: Walk, first: bool) -> Estimate:
        """Estimates the decision, then the range from shortest to longest branch; a single branch may not run."""
        decides, *branches = node.children
        begun, here = walk.follow(decides, first=first), walk.mark()
        taken = [] if len(branches) > 1 else [(Estimate(), here)]
        taken += walk.each_from_here(branches, first)
        shortest, _ = min(taken, key=lambda each: each[0].duration_s)
        longest, end = max(taken, key=lambda each: each[0].duration_s)
        walk.go_to(end)
        most_s, why = max(each.most_s for each, _ in taken), (node.name, *longest.reasons)
        return begun + (shortest if most_s == shortest.most_s else shortest.up_to(most_s, *why))

    def _following(self, child: Behaviour) -> int | None:
        decided = self._index == 0 and child.status == Status.SUCCESS
        return self.branches.get(self.board.get(self.key)) if decided else None


def _choose_plan(assembler: Assembler, block: model.Choose, builder: PlanBuilder) -> Assembled:
    decide, key, parts = decide_plan(assembler.flow, block.condition, builder.at("if"))
    flow = assembler.flow
    then, after_then = assembler.branch(block.then, builder.at("then"), "then", flow)
    other, after_other = assembler.branch(block.otherwise, builder.at("else"), "else", flow)
    flow.join([after_then, after_other])
    branches: dict[Value, NodeSpec] = {True: then.node, **({False: other.node} if block.otherwise else {})}
    node = builder.chosen(f"{block.condition}?", decide, branches, key)
    return Assembled((node,), (*parts, *then.parts, *other.parts))


class Try(MemoryComposite):
    """Composite that runs its second child when the first fails.

    | first child | second child | status |
    |---|---|---|
    | RUNNING, SUCCESS | idle | as the first |
    | FAILURE with ERROR or CANCELLED | idle | FAILURE with its cause |
    | FAILURE with another cause | ticked in the same tick | as the second, with the messages of both |
    | halted | halted | INVALID with CANCELLED |
    """

    kind = "try"

    @classmethod
    def estimate(cls, node: NodeSpec, walk: Walk, first: bool) -> Estimate:
        """Estimates the first possible branch."""
        return walk.possible(node)

    def _following(self, child: Behaviour) -> int | None:
        failed = child.status == Status.FAILURE and cause_of(child) not in FINAL_CAUSES
        return 1 if self._index == 0 and failed else None

    def _take_over(self, child: Behaviour) -> None:
        super()._take_over(child)
        if self._index == 1:
            self.message = f"{self.message}, since {message_of(self.children[0])}"


def _try_plan(assembler: Assembler, block: model.Try, builder: PlanBuilder) -> Assembled:
    flow = assembler.flow
    tried, after_tried = assembler.branch(block.steps, builder.at("try"), "try", flow)
    midway = flow.copy()
    if after_tried.held != flow.held:
        midway.held, midway.opening = held_after_either(flow.held, after_tried.held), False
    other, after_other = assembler.branch(block.otherwise, builder.at("else"), "else", midway)
    flow.join([after_tried, after_other])
    name = ", else ".join(filter(None, map(words_of, (block.steps, block.otherwise))))
    return Assembled((builder.node("try", name, *tried.nodes, *other.nodes),), (*tried.parts, *other.parts))


class Together(MemoryComposite):
    """Parallel composite: each child is ticked until it ends.

    | children | status |
    |---|---|
    | `needed` of them SUCCESS | SUCCESS; the others are halted |
    | so many FAILURE that `needed` cannot succeed | FAILURE with the first cause; the others are halted |
    | else | RUNNING |
    | halted | INVALID with CANCELLED |
    """

    kind = "together"
    needed: int
    _failed: list[Behaviour] = field(default_factory=list, init=False)
    _done: list[Behaviour] = field(default_factory=list, init=False)

    @classmethod
    def estimate(cls, node: NodeSpec, walk: Walk, first: bool) -> Estimate:
        """Estimates parallel branches, which stop when `needed` of them have succeeded.

        The walk continues where the branch with the longest drive ends.
        """
        branches = walk.each_from_here(node.children, first)
        ends_s = sorted(taken.duration_s for taken, _ in branches)[node.options["needed"] - 1]
        shares = [min(1.0, ends_s / taken.duration_s) if taken.duration_s else 1.0 for taken, _ in branches]
        distance_m = sum(share * taken.distance_m for share, (taken, _) in zip(shares, branches, strict=True))
        charge = sum(share * taken.charge for share, (taken, _) in zip(shares, branches, strict=True))
        walk.go_to(max(branches, key=lambda each: each[0].distance_m)[1])
        reasons = tuple(dict.fromkeys(reason for taken, _ in branches for reason in taken.reasons))
        most_s, needed = max(taken.most_s for taken, _ in branches), node.options["needed"]
        if needed < len(branches) and most_s > ends_s:
            done = "the first" if needed == 1 else f"the first {needed}"
            reasons = (f"until {done} of {len(branches)} steps is done", *reasons)
        return Estimate(ends_s, distance_m, charge).up_to(most_s, *reasons)

    def _tick(self) -> Iterator[Behaviour]:
        """Ticks the children that have not ended."""
        if self.status != Status.RUNNING:
            self._restart()
            self._failed, self._done = [], []
        for child in self.children:
            if child in self._done or child in self._failed:
                continue
            yield from child.tick()
            if child.status == Status.SUCCESS:
                self._done.append(child)
            elif child.status != Status.RUNNING:
                self._failed.append(child)
            if len(self._done) == self.needed or len(self.children) - len(self._failed) < self.needed:
                break
        self._judge()
        yield self

    def _judge(self) -> None:
        if len(self._done) == self.needed:
            self._finish(None, "; ".join(map(message_of, self._done)))
        elif len(self.children) - len(self._failed) < self.needed:
            self._finish(cause_of(self._failed[0]), "; ".join(map(message_of, self._failed)))
        else:
            self._go_on("; ".join(message_of(child) for child in self.children if child.status == Status.RUNNING))

    def _finish(self, cause: Cause | None, message: str) -> None:
        for child in self.children:
            if child.status == Status.RUNNING:
                child.stop(Status.INVALID)
        self._end(cause, message)


def _together_plan(assembler: Assembler, block: model.Together, builder: PlanBuilder) -> Assembled:
    flow, made, afters = assembler.flow, [], []
    for number, step in enumerate(block.steps, start=1):
        branch, after = assembler.branch((step,), builder.at(f"branch-{number}"), f"branch {number}", flow)
        made.append(branch)
        afters.append(after)
    _refuse_collisions([each.nodes[0] for each in made], builder)
    everything = block.needed == len(block.steps)
    if everything:
        before = dict(flow.names)
        for after in afters:
            flow.names.update({name: named for name, named in after.names.items() if before.get(name) != named})
    moved = [after.held for after in afters if after.held != flow.held]
    if moved:
        flow.held, flow.opening = (moved[0] if everything else held_after_either(flow.held, *moved)), False
    name = "side by side" if everything else f"side by side, until {block.needed} of {len(block.steps)} are done"
    node = builder.node("together", name, *(each.nodes[0] for each in made), needed=block.needed)
    return Assembled((node,), tuple(part for each in made for part in each.parts))


def _refuse_collisions(branches: Sequence[NodeSpec], builder: PlanBuilder) -> None:
    """Raises InputError for branches that need the same body part of the robot."""
    users: dict[Part, int] = {}
    for number, branch in enumerate(branches, start=1):
        skills = (node.skill for node in branch.walk() if node.skill is not None)
        for part in sorted({part for skill in skills for part in skill.uses}, key=lambda each: each.value):
            if users.setdefault(part, number) != number:
                what = f"steps {users[part]} and {number} both use the {part.value}"
                hint = "do them one after the other"
                raise InputError.at(branch.source or builder.source, f"{what}, and cannot go together", hint=hint)


PLANS: Final[StepPlans] = {model.Choose: _choose_plan, model.Try: _try_plan, model.Together: _together_plan}
