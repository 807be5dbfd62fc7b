"""Plant: the simulated robots and worlds, a Drake Diagram behind the Robot protocol."""
