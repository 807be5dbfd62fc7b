"""Moves the people who take what a robot holds out: each brings a tray under it, pulls at it, and holds the tray still.

A person knows the plant's truth. The tray is a free body without weight whose pose and velocity are set, whatever is
laid on it; it touches robots and loose objects. While it is not in use it is out of sight within the torso. The pull
is a force on the object, and ends as soon as the gripper gives way.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.systems.framework import Context

from plant.diagram import WorldDiagram
from plant.people.offers import Offers
from plant.people.receiver import Receiver
from plant.snapshot.values import State
from plant.worlds.placement import Receiving

LOOK_STEPS = 4
"""Everybody looks whether something is held out once in so many steps."""


class Receivers:
    """The people of one plant who receive, by name. `before_step` is to be called before each step."""

    def __init__(self, world: WorldDiagram, context: Context, receiving: Mapping[str, Receiving]) -> None:
        """`context` is the plant's; those with a tray who are not in `receiving` take things in the usual manner."""
        self._plant, self._context = world.plant, context
        self._offers = Offers(world, context)
        self._people = {
            name: Receiver(world, context, name, receiving.get(name, Receiving()), self._offers)
            for name in sorted(world.trays)
        }
        self._steps = 0
        self._pulling = False

    def __getitem__(self, name: str) -> Receiver:
        """One of them. Raises KeyError."""
        return self._people[name]

    @property
    def busy(self) -> Collection[str]:
        """Those who take something, or have something on their tray."""
        return [name for name, person in self._people.items() if person.busy]

    def before_step(self, now_s: float, dt_s: float, holding: Sequence[str]) -> None:
        """Look, move the trays and pull; `holding` names the robots that hold something."""
        if self._steps % LOOK_STEPS == 0:
            self._offers.look(now_s, holding)
            for person in self._people.values():
                person.look(now_s)
        self._steps += 1
        pulls = [each for person in self._people.values() if (each := self._pull(person, now_s)) is not None]
        if pulls or self._pulling:
            self._plant.get_applied_spatial_force_input_port().FixValue(self._context, pulls)
        self._pulling = bool(pulls)
        for person in self._people.values():
            person.move_tray(dt_s)

    def _pull(self, person: Receiver, now_s: float) -> ExternallyAppliedSpatialForce | None:
        """The force with which a person pulls just now."""
        force_W = person.pull_W(now_s)
        if force_W is None or person.offer is None:
            return None
        pull = ExternallyAppliedSpatialForce()
        pull.body_index = person.offer.body.index()
        pull.p_BoBq_B = person.offer.body.default_com()
        pull.F_Bq_W = SpatialForce(np.zeros(3), force_W)
        return pull

    def state(self) -> State:
        """What everybody is about."""
        people = {name: person.state() for name, person in self._people.items()}
        return {"steps": self._steps, "offers": self._offers.state(), "people": people}

    def restore(self, state: State) -> None:
        """Go on from such a state; the trays are where the plant has them. Raises KeyError: somebody is not in it."""
        self._steps = state["steps"]
        self._offers.restore(state["offers"])
        for name, person in self._people.items():
            person.restore(state["people"][name])
