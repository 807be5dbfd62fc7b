"""An engine that several tests use, put back to where it began before each."""


class KeptEngine:
    """An engine with its state at the beginning, its observers and its events."""

    def __init__(self, engine):
        self._engine, self._state = engine, engine.state()
        self._world = {name: each.copy() for name, each in engine.world_state().items()}
        self._lists = (engine.words, engine.events, engine._observers, engine._after_advance)
        self._before = [[*each] for each in self._lists]

    def again(self):
        """The engine as at the beginning: its robots have no lease and no commands, and nobody else observes it."""
        for each, before in zip(self._lists, self._before, strict=True):
            each[:] = before
        self._engine.resume(self._state, self._world)
        return self._engine
