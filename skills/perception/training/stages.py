"""What the networks that are there already see in a picture, for those that come after them. Needs no torch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skills.perception.detector.cascade_files import DetectorModel
from skills.perception.detector.crops import refined
from skills.perception.detector.proposals import ProposalOptions
from skills.perception.detector.scales import Scales

__all__ = ["proposed", "refined_by"]

Floats = NDArray[np.float32]


def proposed(model: DetectorModel, scales: Scales) -> tuple[Floats, Floats]:
    """Boxes (A, 4) and scores (A, K) of the proposal network in a picture's letterbox."""
    boxes, scores = model.proposal.session.run(["boxes", "scores"], {"images": scales.full[None]})
    return boxes[0], scores[0]


def refined_by(model: DetectorModel, scales: Scales) -> tuple[Floats, Floats]:
    """Boxes (R, 4) and scores (R, K) of the refinement network where it looks in use. Raises ValueError without one."""
    if model.refinement is None:
        raise ValueError("there is no refinement network")
    return refined(model.refinement.session, scales, *proposed(model, scales), ProposalOptions())
