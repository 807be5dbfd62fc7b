"""Fixtures of the executive's tests: a context for nodes, a scripted robot, and what they publish."""

from tests.executive.conftest import (  # noqa: F401 - fixtures
    clock,
    context,
    knowledge,
    published,
    registry,
    robot,
    run_tree,
    script,
)
