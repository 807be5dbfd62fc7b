"""Cubes and cylinders: plain, painted, of wood or metal, with patterns; of many sizes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from plant.dataset.objects.draft import Draft, Finished, shade
from plant.dataset.objects.lettering import write_word
from plant.dataset.objects.wear import brushed, plain, used
from plant.models.builder.pictures import cloth, noise, speckle, wood
from plant.models.builder.surfaces import add_rounded_box
from skills.robot import FloatArray

COLOURS = {
    "red": (0.80, 0.08, 0.07),
    "blue": (0.08, 0.22, 0.72),
    "green": (0.10, 0.52, 0.18),
    "yellow": (0.95, 0.80, 0.08),
    "orange": (0.93, 0.45, 0.06),
    "white": (0.92, 0.92, 0.91),
    "black": (0.09, 0.09, 0.10),
    "purple": (0.42, 0.16, 0.58),
    "grey": (0.52, 0.53, 0.54),
    "cyan": (0.10, 0.68, 0.76),
    "pink": (0.92, 0.48, 0.62),
    "brown": (0.42, 0.26, 0.13),
}
FINISHES = ("painted", "plain", "wood", "metal", "striped", "checked", "foam", "lettered")
_DENSITIES = {
    "painted": 600.0,
    "plain": 500.0,
    "wood": 620.0,
    "metal": 2700.0,
    "striped": 550.0,
    "checked": 500.0,
    "foam": 60.0,
    "lettered": 600.0,
}


@dataclass(frozen=True)
class BlockForm:
    """Finish, colours by name, wear 0..1."""

    finish: str
    colour: str
    second: str
    wear: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Self:
        """Any finish in any two colours."""
        first, second = rng.permutation(list(COLOURS))[:2]
        finish = str(rng.choice(FINISHES, p=[0.26, 0.22, 0.16, 0.08, 0.08, 0.07, 0.06, 0.07]))
        return cls(finish, str(first), str(second), float(rng.uniform(0, 0.7)))

    @property
    def colour_name(self) -> str:
        """The main colour as one would say it."""
        return {"wood": "brown", "metal": "grey"}.get(self.finish, self.colour)


def _face(draft: Draft, form: BlockForm) -> FloatArray:
    """The picture on the sides."""
    rng, shape = draft.rng, (128, 128)
    a, b = shade(rng, COLOURS[form.colour], 0.05), shade(rng, COLOURS[form.second], 0.05)
    rows, columns = np.indices(shape)
    if form.finish == "wood":
        tones = ((0.85, 0.68, 0.44), (0.72, 0.50, 0.28), (0.50, 0.32, 0.18))
        return used(wood(rng, shape, tones[int(rng.integers(3))], 0.08), rng, form.wear * 0.4, (0.5, 0.35, 0.2))
    if form.finish == "metal":
        return used(brushed(rng, (0.66, 0.67, 0.69)), rng, form.wear)
    if form.finish == "foam":
        return cloth(rng, shape, (float(a[0]), float(a[1]), float(a[2])), 0.12)
    image = plain(a, shape)
    if form.finish == "striped":
        image[(rows // int(rng.integers(12, 40))) % 2 == 0] = b
    if form.finish == "checked":
        size = 128 // int(rng.integers(2, 5))
        image[((rows // size) + (columns // size)) % 2 == 0] = b
    if form.finish == "lettered":
        write_word(
            image,
            str(rng.choice(list("ABCDEFGHKMRSTX123456789"))),
            (0.12, 0.12, 0.88, 0.88),
            b,
            face=int(rng.integers(9)),
        )
    if form.finish == "painted" and rng.random() < 0.5:
        return used(image * (1 + 0.05 * noise(rng, shape, (1, 30)))[..., None], rng, form.wear, b)
    if form.finish == "plain":
        return image if rng.random() < 0.5 else speckle(rng, shape, (float(a[0]), float(a[1]), float(a[2])), 0.03)
    return used(image, rng, form.wear * 0.6, b)


def cube(draft: Draft) -> tuple[Finished, str, str]:
    """A cube with sharp or rounded edges."""
    rng = draft.rng
    form = BlockForm.drawn(rng)
    size = float(np.exp(rng.uniform(np.log(0.03), np.log(0.22))))
    image = _face(draft, form)
    low, high = np.full(3, -size / 2), np.full(3, size / 2)
    part = draft.part()
    faces = {}
    for k, face in enumerate(("-x", "+x", "-y", "+y", "-z", "+z")):
        faces[face] = draft.picture(
            f"face{k}",
            np.rot90(image, int(rng.integers(4))),
            shine=_shine(form, rng),
            metal=float(form.finish == "metal"),
        )
    if rng.random() < 0.45 or form.finish in ("striped", "checked", "lettered"):
        part.add_box("face0", low, high, faces=faces)
    else:
        add_rounded_box(part, "face0", low, high, size * float(rng.uniform(0.02, 0.09)), top="face1")
    draft.solid(part, _DENSITIES[form.finish])
    return draft.finish(), form.finish, form.colour_name


def cylinder(draft: Draft) -> tuple[Finished, str, str]:
    """A cylinder, from disc to rod."""
    rng = draft.rng
    form = BlockForm.drawn(rng)
    radius = float(np.exp(rng.uniform(np.log(0.015), np.log(0.075))))
    height = min(0.40, max(0.03, radius * float(np.exp(rng.uniform(np.log(0.9), np.log(8.0))))))
    image = _face(draft, form)
    around = np.concatenate([image, image], axis=1) if form.finish in ("lettered", "checked") else image
    metal = float(form.finish == "metal")
    draft.picture("side", around, shine=_shine(form, rng), metal=metal)
    same = rng.random() < 0.75
    cap = image if same or form.finish in ("wood", "metal") else plain(COLOURS[form.second])
    draft.paint("cap", cap.mean(axis=(0, 1)), shine=_shine(form, rng), metal=metal)
    edge = min(radius, height) * float(rng.choice([0.0, 0.03, 0.08]))
    part, half = draft.part(), height / 2
    part.add_lathe(
        "cap",
        [(0, -half), (radius - edge, -half), (radius, -half + edge)] if edge else [(0, -half), (radius, -half)],
        sides=40,
    )
    part.add_lathe("side", [(radius, -half + edge), (radius, half - edge)], sides=40)
    part.add_lathe(
        "cap",
        [(radius, half - edge), (radius - edge, half), (0, half)] if edge else [(radius, half), (0, half)],
        sides=40,
    )
    draft.solid(part, _DENSITIES[form.finish])
    draft.collide_upright(radius, -half, half)
    return draft.finish(), form.finish, form.colour_name


def _shine(form: BlockForm, rng: np.random.Generator) -> float:
    return {"metal": 0.65, "foam": 0.0}.get(form.finish, float(rng.uniform(0.1, 0.6)))
