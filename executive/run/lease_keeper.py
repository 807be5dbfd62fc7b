"""Keeps a robot's lease for a run: one token for all who hold a context, whatever lease stands behind it just now."""

from __future__ import annotations

from skills.robot import Lease, LeaseError, Robot


class LeaseKeeper:
    """Acquires a lease at once (raises LeaseError), notices when another took it, and gets it back when it is free.

    Skills and nodes hold `token`, which stays the same; `behind` turns it into the lease that counts.
    """

    def __init__(self, robot: Robot, holder: str) -> None:
        self._robot, self._holder = robot, holder
        self.token: Lease = robot.acquire_lease(holder)
        self._current = self.token

    def behind(self, lease: Lease) -> Lease:
        """The lease to show the robot for one that a skill shows."""
        return self._current if lease == self.token else lease

    def lost(self) -> str | None:
        """Why the robot would refuse to move for us, None when it would not."""
        counts = self._robot.lease_holder()
        if counts == self._current:
            return None
        return f"{counts.holder} holds the lease of {self._robot.name}" if counts else "the lease was given back"

    def regain(self) -> bool:
        """Acquire the lease again when it is free; True when it was."""
        if self._robot.lease_holder() is not None:
            return False
        try:
            self._current = self._robot.acquire_lease(self._holder)
        except LeaseError:
            return False
        return True

    def give_back(self) -> None:
        """Return the lease; the robot stops."""
        self._robot.return_lease(self._current)
