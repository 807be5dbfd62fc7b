"""Makes the robots and scenes of the skills' tests importable, and the trees of the executive's."""

import sys

from tests.executive.conftest import (  # noqa: F401 - fixtures
    changes_missed,
    clock,
    compiled,
    context,
    knowledge,
    make,
    published,
    registry,
    robot,
    run_tree,
    script,
)
from tests.sources import ROOT

sys.path.append(str(ROOT / "tests" / "skills"))
