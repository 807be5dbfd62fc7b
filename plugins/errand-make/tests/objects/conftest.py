"""Makes the robots and scenes of the skills' tests importable."""

import sys

from tests.sources import ROOT

sys.path.append(str(ROOT / "tests" / "skills"))
