"""Who may move a robot."""

from __future__ import annotations

from skills.robot import Lease, LeaseError


class LeaseManager:
    """Hands out one robot's lease; the lease with the highest number counts."""

    def __init__(self, robot_name: str) -> None:
        self._robot_name = robot_name
        self._number = 0
        self._current: Lease | None = None

    @property
    def current(self) -> Lease | None:
        """The lease that counts, None while it is free."""
        return self._current

    def acquire(self, holder: str) -> Lease:
        """A lease for `holder`. Raises LeaseError while another's is out."""
        if self._current is not None:
            raise LeaseError(
                f"{self._robot_name}: the lease is held by {self._current.holder!r}; ask for its return, or take it"
            )
        return self.take(holder)

    def take(self, holder: str) -> Lease:
        """A lease for `holder`, from whoever has it."""
        self._number += 1
        self._current = Lease(self._robot_name, holder, self._number)
        return self._current

    def give_back(self, lease: Lease) -> bool:
        """True when `lease` was the one that counted."""
        if lease != self._current:
            return False
        self._current = None
        return True

    def refusal(self, lease: Lease) -> str | None:
        """Why `lease` gives no right to move, or None when it does."""
        if lease == self._current:
            return None
        holder = self._current.holder if self._current else "nobody"
        return f"lease {lease.number} of {lease.holder!r} no longer counts; the lease is held by {holder!r}"
