"""Credentials of a server."""

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")

from errand_spot.server import identity


@pytest.fixture(scope="session")
def credentials(tmp_path_factory):
    return identity.credentials(tmp_path_factory.mktemp("credentials"))
