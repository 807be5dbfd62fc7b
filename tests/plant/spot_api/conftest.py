"""Credentials of a server."""

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install 'spot-errand[spot]'")

from plant.spot_api.server.server import SpotServer


@pytest.fixture(scope="session")
def credentials(tmp_path_factory):
    return SpotServer.credentials(tmp_path_factory.mktemp("credentials"))
