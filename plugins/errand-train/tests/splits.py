"""Parts of a data set on disk, as `errand dataset train` makes them."""

import json

import cv2


def write_split(folder, split, pictures, boxes, names):
    """Writes pictures and their labels; each shows all `boxes` (x, y, width, height), of the classes in turn."""
    images, labels = [], []
    for number, picture in enumerate(pictures):
        height, width, _ = picture.shape
        name = f"{split}{number}.png"
        cv2.imwrite(str(folder / name), picture)
        images.append({"id": number, "file_name": name, "width": width, "height": height})
        for box in boxes:
            label = {"id": len(labels), "image_id": number, "category_id": 1 + len(labels) % 2, "bbox": box}
            labels.append(label)
    categories = [{"id": number, "name": name} for number, name in enumerate(names, start=1)]
    document = {"images": images, "annotations": labels, "categories": categories}
    (folder / f"{split}.json").write_text(json.dumps(document))
