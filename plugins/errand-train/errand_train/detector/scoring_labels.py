"""Labels for the evaluation of a detector, and rules for which of them count."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from errand_train.detector.coco import CocoLabel, coco_file
from executive.language.spelling import synonyms_of
from skills.perception.detector.camera_images import LEAST_ROLL_DEG

LEAST_LONG_PX: Final = 24.0
LEAST_SHORT_PX: Final = 8.0
LEAST_VISIBILITY: Final = 0.4

Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Label:
    """An object in a picture: its class, and its box (u0, v0, u1, v1) in pixels.

    `crowd` marks a region that absorbs any number of detections of the class, `ignore` an object whose detection does
    not matter. `visibility` is the visible share of the whole object (parts beyond the picture's edge are hidden),
    `distance_m` its distance, where known.
    """

    class_name: str
    box: Box
    crowd: bool = False
    ignore: bool = False
    visibility: float | None = None
    distance_m: float | None = None

    @property
    def judged(self) -> bool:
        """Returns whether a detector should find the label."""
        return not (self.crowd or self.ignore)

    @property
    def large_enough(self) -> bool:
        """Returns whether its box is at least 24 pixels long and 8 wide."""
        return large_enough(self.box)

    @property
    def seen_enough(self) -> bool:
        """Returns whether at least 40 % of the object are visible; assumed where unknown."""
        return self.visibility is None or self.visibility >= LEAST_VISIBILITY

    @property
    def counts(self) -> bool:
        """Returns whether the label counts in the main figures."""
        return self.judged and self.large_enough and self.seen_enough


@dataclass(frozen=True)
class LabelledPicture:
    """A picture's file name in its data set, its labels, and its width and height if known.

    `camera` is the name of its camera, and `is_upside_down` whether it hung upside down, if the data set says so.
    `crowded` ones are of scenes with more objects than usual.
    """

    file: str
    labels: tuple[Label, ...] = ()
    size_px: tuple[int, int] | None = None
    is_upside_down: bool = False
    camera: str | None = None
    crowded: bool = False

    @property
    def only_distractors(self) -> bool:
        """Returns whether the picture has no label at all, ignored ones included."""
        return not self.labels


def long_side_px(box: Box) -> float:
    """Longer side of a box (u0, v0, u1, v1)."""
    return max(box[2] - box[0], box[3] - box[1])


def large_enough(box: Box) -> bool:
    """Returns whether a box is large enough to count."""
    return long_side_px(box) >= LEAST_LONG_PX and min(box[2] - box[0], box[3] - box[1]) >= LEAST_SHORT_PX


@dataclass(frozen=True)
class LabelledPictures:
    """Pictures of a COCO file, the categories that are read as another class, and the labels left out by category.

    `outside`: the numbers of the labels that are left out since their boxes have no area in their pictures.
    """

    pictures: tuple[LabelledPicture, ...]
    aliases: Mapping[str, str]
    left_out: Mapping[str, int]
    outside: tuple[int, ...] = ()


def pictures_of_coco(document: object, class_names: Sequence[str]) -> LabelledPictures:
    """Reads the pictures of a COCO file in the order of their ids, with the labels of the named classes.

    Categories match by name or by a synonym of one class, in upper or lower case; their ids may be any. Leaves out
    labels of other categories, and those without an area in their picture. Raises ValueError, naming the entry.
    """
    coco = coco_file(document)
    coco.refuse_other_boxes()
    ours = {name.casefold(): name for name in class_names}
    names = {one.id: _class_of(one.name.strip().casefold(), ours) for one in coco.categories}
    if not any(names.values()):
        told = ", ".join(one.name for one in coco.categories)
        raise ValueError(f"categories: none of '{told}' is a class that is known ({', '.join(class_names)})")
    for k, label in enumerate(coco.annotations):
        if label.category_id not in names:
            raise ValueError(f"annotations[{k}].category_id: there is no category {label.category_id!r}")
    counts = Counter(label.category_id for label in coco.annotations)
    others = {one.id: (one.name, names[one.id]) for one in coco.categories}
    pictures = sorted(coco.by_picture(), key=lambda pair: (isinstance(pair[0].id, str), pair[0].id))
    sizes = {image.id: image.size_px for image in coco.images}
    outside = tuple(k for k, one in enumerate(coco.annotations) if not one.is_in(sizes.get(one.image_id)))
    found = tuple(
        LabelledPicture(
            file=image.file_name,
            labels=tuple(
                _label(one, name)
                for one in labels
                if (name := names[one.category_id]) is not None and one.is_in(image.size_px)
            ),
            size_px=image.size_px,
            is_upside_down=abs(image.roll_deg) > LEAST_ROLL_DEG,
            camera=image.camera,
            crowded=image.crowded,
        )
        for image, labels in pictures
    )
    return LabelledPictures(
        found,
        {
            name: ours
            for name, ours in others.values()
            if ours is not None and ours.casefold() != name.strip().casefold()
        },
        {name: counts[number] for number, (name, ours) in others.items() if ours is None},
        outside,
    )


def _class_of(name: str, ours: Mapping[str, str]) -> str | None:
    """Class of a category's name: the same word, or the only class of which it is a synonym."""
    if name in ours:
        return ours[name]
    meant = synonyms_of(name.replace("_", " "), ours)
    return meant[0] if len(meant) == 1 else None


def _label(one: CocoLabel, name: str) -> Label:
    x, y, width, height = one.bbox
    return Label(name, (x, y, x + width, y + height), one.iscrowd, one.ignore, one.seen, one.distance_m)
