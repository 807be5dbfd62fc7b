"""COCO files: pictures, labels and categories, with the fields of the project's data sets."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError

Id = Annotated[
    int | str, AfterValidator(lambda name: int(name) if isinstance(name, str) and name.isdecimal() else name)
]
"""A number, also when the file writes it as text, or another text."""


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)


class CocoImage(_Entry):
    """A picture; `crowded` ones are of scenes with more objects than usual. Backslashes in its name become slashes."""

    id: Id
    file_name: Annotated[str, AfterValidator(lambda name: name.replace("\\", "/"))]
    width: int | None = None
    height: int | None = None
    roll_deg: float = 0.0
    camera: str | None = None
    crowded: bool = False

    @property
    def size_px(self) -> tuple[int, int] | None:
        """Width and height, if the file has them."""
        return None if self.width is None or self.height is None else (self.width, self.height)


class CocoLabel(_Entry):
    """An object in a picture, its box (x, y, width, height) in pixels, and its mask.

    `visibility` is the unoccluded share of the object's pixels in the picture, `truncation` the share of the object
    beyond the picture's edge.
    """

    image_id: Id
    category_id: Id
    bbox: tuple[float, float, float, float]
    segmentation: Any = None
    iscrowd: bool = False
    ignore: bool = False
    visibility: float | None = None
    truncation: float | None = None
    distance_m: float | None = None

    def is_in(self, size_px: tuple[int, int] | None) -> bool:
        """True when the box has an area in a picture of this size, if that is known."""
        x, y, width, height = self.bbox
        right, bottom = (x + width, y + height) if size_px is None else size_px
        return width > 0 and height > 0 and x < right and y < bottom and x + width > 0 and y + height > 0

    @property
    def seen(self) -> float | None:
        """Visible share of the whole object, if the file has it."""
        if self.visibility is None and self.truncation is None:
            return None
        return (1.0 if self.visibility is None else self.visibility) * (1.0 - (self.truncation or 0.0))


class CocoCategory(_Entry):
    """A class."""

    id: Id
    name: str


class CocoFile(_Entry):
    """A whole COCO file. Every label belongs to one of its pictures."""

    images: tuple[CocoImage, ...]
    annotations: tuple[CocoLabel, ...]
    categories: tuple[CocoCategory, ...]

    def by_picture(self) -> list[tuple[CocoImage, list[CocoLabel]]]:
        """Pairs each picture with its labels. Raises ValueError for a label of an unknown picture."""
        labels: dict[int | str, list[CocoLabel]] = {image.id: [] for image in self.images}
        for k, label in enumerate(self.annotations):
            if label.image_id not in labels:
                raise ValueError(f"annotations[{k}].image_id: there is no image {label.image_id!r}")
            labels[label.image_id].append(label)
        return [(image, labels[image.id]) for image in self.images]

    def refuse_doubles(self) -> None:
        """Raises ValueError when pictures or categories have one id, or pictures one file, as in files put together."""
        lists = {
            "images": [(image.id, image.file_name) for image in self.images],
            "categories": [(category.id, category.name) for category in self.categories],
        }
        for what, pairs in lists.items():
            first = dict[int | str, int]()
            for k, (key, name) in enumerate(pairs):
                other = first.setdefault(key, k)
                if other != k and (what == "images" or pairs[other][1] != name):
                    both = f"{key!r} ({name}) is also the id of {what}[{other}] ({pairs[other][1]})"
                    raise ValueError(f"{what}[{k}].id: {both}")
        files = dict[str, int]()
        for k, image in enumerate(self.images):
            if (other := files.setdefault(image.file_name, k)) != k:
                raise ValueError(f"images[{k}].file_name: {image.file_name} is also the file of images[{other}]")

    def refuse_other_boxes(self) -> None:
        """Raises ValueError when the boxes are shares of the pictures' sides, or corners, instead of COCO's pixels."""
        wanted = "COCO's are x, y, width and height in pixels"
        if self.annotations and all(max(label.bbox) <= 1.0 for label in self.annotations):
            raise ValueError(f"annotations[0].bbox: the boxes are shares of the pictures' sides, and {wanted}")
        sizes = {image.id: image.size_px for image in self.images}
        boxes = [(label.bbox, size) for label in self.annotations if (size := sizes.get(label.image_id)) is not None]
        beyond = [k for k, ((x, y, w, h), size) in enumerate(boxes) if x + w > size[0] + 1 or y + h > size[1] + 1]
        if 2 * len(beyond) > len(boxes) and all(x < w <= size[0] and y < h <= size[1] for (x, y, w, h), size in boxes):
            box = ", ".join(f"{value:g}" for value in boxes[beyond[0]][0])
            raise ValueError(f"annotations: the boxes are corners, such as [{box}], and {wanted}")


def coco_file(document: object) -> CocoFile:
    """Validates a COCO file of a JSON value. Raises ValueError with the first wrong entry, or one id given twice."""
    try:
        file = CocoFile.model_validate(document)
    except ValidationError as error:
        first = error.errors()[0]
        place = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in first["loc"])
        raise ValueError(
            f"{place.removeprefix('.') or 'the file'}: {first['msg']}, not {first['input']!r:.60}"
        ) from error
    file.refuse_doubles()
    return file
