"""What pictures are known to hold, as a detector is judged by it, and which of it counts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from skills.perception.detector.upright import LEAST_ROLL_DEG

__all__ = ["LEAST_LONG_PX", "LEAST_SHORT_PX", "LEAST_VISIBILITY", "Label", "LabelledPicture", "pictures_of_coco"]

LEAST_LONG_PX: Final = 24.0
LEAST_SHORT_PX: Final = 8.0
LEAST_VISIBILITY: Final = 0.4

Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Label:
    """An object in a picture: its class, and its box (u0, v0, u1, v1) in pixels.

    `crowd` marks a region in which any number of detections of the class is passed over, `ignore` an object that need
    not be found and may be. `visibility` is the share of the whole object that is seen (what lies beyond the picture's
    edge is not), `distance_m` how far it is, where known.
    """

    class_name: str
    box: Box
    crowd: bool = False
    ignore: bool = False
    visibility: float | None = None
    distance_m: float | None = None

    @property
    def judged(self) -> bool:
        """Whether the file asks for it at all."""
        return not (self.crowd or self.ignore)

    @property
    def large_enough(self) -> bool:
        """Whether its box is at least 24 pixels long and 8 wide."""
        return large_enough(self.box)

    @property
    def seen_enough(self) -> bool:
        """Whether at least 40 % of it are seen; taken for granted where unknown."""
        return self.visibility is None or self.visibility >= LEAST_VISIBILITY

    @property
    def counts(self) -> bool:
        """Whether it counts in the main figures."""
        return self.judged and self.large_enough and self.seen_enough


@dataclass(frozen=True)
class LabelledPicture:
    """A picture's file, as named by its data set, all that is known to be in it, and its width and height if known.

    `camera` is the name of its camera, and `on_its_head` whether that hung upside down, where the data set tells.
    """

    file: str
    labels: tuple[Label, ...] = ()
    size_px: tuple[int, int] | None = None
    on_its_head: bool = False
    camera: str | None = None

    @property
    def only_distractors(self) -> bool:
        """Whether it holds nothing of any class, not even something to ignore."""
        return not self.labels


def long_side_px(box: Box) -> float:
    """The longer side of a box (u0, v0, u1, v1)."""
    return max(box[2] - box[0], box[3] - box[1])


def large_enough(box: Box) -> bool:
    """Whether a box is of a size that counts."""
    return long_side_px(box) >= LEAST_LONG_PX and min(box[2] - box[0], box[3] - box[1]) >= LEAST_SHORT_PX


def pictures_of_coco(document: Mapping[str, Any], class_names: Sequence[str]) -> tuple[LabelledPicture, ...]:
    """The pictures of a COCO file in the order of their ids, with the labels of the named classes.

    Categories go by their names, in any case of letters; their ids may be any. Labels of other categories are left
    out. `visibility`, `truncation`, `distance_m`, `iscrowd` and `ignore` of labels, and `roll_deg` of pictures need not
    be there. Raises ValueError, naming the entry.
    """
    names = _category_names(document, class_names)
    files = {_number_of(image, "id", "images", k): image for k, image in enumerate(_entries(document, "images"))}
    labels: dict[Any, list[Label]] = {number: [] for number in files}
    for k, entry in enumerate(_entries(document, "annotations")):
        picture = _number_of(entry, "image_id", "annotations", k)
        category = _number_of(entry, "category_id", "annotations", k)
        if picture not in labels or category not in names:
            raise ValueError(f"annotations[{k}]: it names image {picture!r} of category {category!r}, one is not there")
        name = names[category]
        if name is not None:
            labels[picture].append(_label(entry, name, k))
    order = sorted(files, key=lambda number: (isinstance(number, str), number))
    return tuple(
        LabelledPicture(
            file=str(_value(files[number], "file_name", "images", k)),
            labels=tuple(labels[number]),
            size_px=_size(files[number]),
            on_its_head=_on_its_head(files[number], k),
            camera=None if files[number].get("camera") is None else str(files[number]["camera"]),
        )
        for k, number in enumerate(order)
    )


def _category_names(document: Mapping[str, Any], class_names: Sequence[str]) -> dict[Any, str | None]:
    """Our name of each category id, None for a class that is none of ours. Raises ValueError when all are."""
    ours = {name.casefold(): name for name in class_names}
    entries = list(_entries(document, "categories"))
    categories = {
        _number_of(one, "id", "categories", k): str(_value(one, "name", "categories", k))
        for k, one in enumerate(entries)
    }
    names = {number: ours.get(name.strip().casefold()) for number, name in categories.items()}
    if not any(names.values()):
        known = ", ".join(class_names)
        raise ValueError(
            f"categories: none of {', '.join(categories.values()) or 'them'} is a class that is known ({known})"
        )
    return names


def _label(entry: Mapping[str, Any], name: str, k: int) -> Label:
    box = _value(entry, "bbox", "annotations", k)
    try:
        x, y, width, height = (float(value) for value in box)
        return Label(
            class_name=name,
            box=(x, y, x + width, y + height),
            crowd=bool(entry.get("iscrowd", 0)),
            ignore=bool(entry.get("ignore", 0)),
            visibility=_share_seen(entry),
            distance_m=_number(entry.get("distance_m")),
        )
    except (TypeError, ValueError) as error:
        why = f"bbox is four numbers (x, y, width, height), not {box!r}, or another of its fields is none"
        raise ValueError(f"annotations[{k}]: {why}") from error


def _share_seen(entry: Mapping[str, Any]) -> float | None:
    """Of what is in the picture the share before which nothing stands, times the share that is in the picture."""
    in_front, beyond = _number(entry.get("visibility")), _number(entry.get("truncation"))
    if in_front is None and beyond is None:
        return None
    return (1.0 if in_front is None else in_front) * (1.0 - (beyond or 0.0))


def _size(image: Mapping[str, Any]) -> tuple[int, int] | None:
    width, height = image.get("width"), image.get("height")
    return (width, height) if isinstance(width, int) and isinstance(height, int) else None


def _on_its_head(image: Mapping[str, Any], k: int) -> bool:
    roll_deg = image.get("roll_deg", 0.0)
    if not isinstance(roll_deg, int | float):
        raise ValueError(f"images[{k}]: 'roll_deg' is a number of degrees, not {roll_deg!r}")
    return abs(roll_deg) > LEAST_ROLL_DEG


def _number(value: Any) -> float | None:
    return None if value is None else float(value)


def _entries(document: Mapping[str, Any], key: str) -> Iterable[Mapping[str, Any]]:
    entries = document.get(key) if isinstance(document, Mapping) else None
    if not isinstance(entries, list) or not all(isinstance(entry, Mapping) for entry in entries):
        raise ValueError(f"it has no list '{key}' of objects, as a COCO file does")
    return entries


def _number_of(entry: Mapping[str, Any], key: str, group: str, k: int) -> int | str:
    """An entry's number, which some files give as text."""
    value = _value(entry, key, group, k)
    if not isinstance(value, int | str):
        raise ValueError(f"{group}[{k}]: '{key}' is a number, not {value!r}")
    return value


def _value(entry: Mapping[str, Any], key: str, group: str, k: int) -> Any:
    if key not in entry:
        raise ValueError(f"{group}[{k}]: it has no '{key}'")
    return entry[key]
