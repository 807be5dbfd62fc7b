"""Plant: simulated robots and worlds, built as a Drake Diagram behind the Robot protocol."""
