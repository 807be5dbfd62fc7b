"""Credentials of a server."""

import os

import pytest

os.environ.setdefault("GRPC_ENABLE_FORK_SUPPORT", "0")  # else a program that a test starts may die in the fork
pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")

from errand_spot.server import identity


@pytest.fixture(scope="session")
def credentials(tmp_path_factory):
    return identity.credentials(tmp_path_factory.mktemp("credentials"))
