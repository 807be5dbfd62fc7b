"""Models of upright cans, as `errand object import` would describe them."""

import numpy as np

from skills.files.object_model import ObjectModel


def can_model(name, radius, height, colour, points=2000):
    """A can with its origin in the middle, evenly sampled, that stands."""
    rng = np.random.default_rng(3)
    turn, share = rng.uniform(0, 2 * np.pi, points), rng.uniform(-0.5, 0.5, points)
    side = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(points)])
    lid = rng.random(points) < radius / (radius + height)
    up = np.where(share > 0, 1.0, -1.0)[:, None] * [0.0, 0.0, 1.0]
    within = radius * np.sqrt(rng.random(points))[:, None]
    on_lid, on_side = within * side + 0.5 * height * up, radius * side + height * share[:, None] * [0.0, 0.0, 1.0]
    return ObjectModel(
        name,
        np.where(lid[:, None], on_lid, on_side),
        np.where(lid[:, None], up, side),
        np.tile(np.array(colour, np.uint8), (points, 1)),
        np.eye(3)[None],
    )
