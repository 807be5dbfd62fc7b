"""What the networks that are there already see in a picture, for those that come after them. Needs no torch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skills.detect.detector_file import DetectorModel
from skills.detect.region_look import looked_again
from skills.detect.regions import RegionOptions
from skills.detect.scales import Scales

__all__ = ["seen_by_first", "seen_by_second"]

Floats = NDArray[np.float32]


def seen_by_first(model: DetectorModel, scales: Scales) -> tuple[Floats, Floats]:
    """Boxes (A, 4) and scores (A, K) of the first network in a picture's letterbox."""
    boxes, scores = model.first.session.run(["boxes", "scores"], {"images": scales.full[None]})
    return boxes[0], scores[0]


def seen_by_second(model: DetectorModel, scales: Scales) -> tuple[Floats, Floats]:
    """Boxes (R, 4) and scores (R, K) of the second network where it looks in use. Raises ValueError without one."""
    if model.second is None:
        raise ValueError("there is no second network")
    return looked_again(model.second.session, scales, *seen_by_first(model, scales), RegionOptions())
