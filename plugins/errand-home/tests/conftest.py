"""Fixtures of the executive's tests: a context for nodes, and what they publish."""

from tests.executive.conftest import clock, context, published, robot  # noqa: F401 - fixtures
