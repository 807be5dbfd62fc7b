"""Credentials of a server."""

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install 'spot-errand[spot]'")

from plant.spot_api.server import identity


@pytest.fixture(scope="session")
def credentials(tmp_path_factory):
    return identity.credentials(tmp_path_factory.mktemp("credentials"))
