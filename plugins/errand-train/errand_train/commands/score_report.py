"""Report of a detector's figures, as JSON and as tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console

from errand_train.detector.scoring import Bin, ClassScore, Score
from executive.cli.output import show_table

__all__ = ["scores_json", "show_scores"]


def scores_json(scores: Mapping[str, Score], pictures_per_second: float) -> dict[str, Any]:
    """Figures as JSON values: of all pictures, and by camera where the data set names cameras."""
    cameras = {name: _json(one) for name, one in scores.items() if name != "all"}
    return {**_json(scores["all"]), "frames_per_second": round(pictures_per_second, 1), "by_camera": cameras}


def _json(score: Score) -> dict[str, Any]:
    """Figures of some pictures; null where there are none."""
    return {
        "pictures": score.pictures,
        "mAP50": _rounded(score.map50),
        "mAP50-95": _rounded(score.map50_95),
        "precision": _rounded(score.precision),
        "recall": _rounded(score.recall),
        "per_class": {one.name: _class_json(one) for one in score.classes},
        "distractor_pictures": score.distractor_pictures,
        "false_per_100_distractor_pictures": _rounded(score.false_per_100_distractor_pictures),
        "by_size_px": _bins_json(score.by_size_px),
        "by_distance_m": _bins_json(score.by_distance_m),
        "by_visibility": _bins_json(score.by_visibility),
    }


def _class_json(one: ClassScore) -> dict[str, Any]:
    return {
        "labels": one.labels,
        "AP50": _rounded(one.ap50),
        "AP50-95": _rounded(one.ap50_95),
        "precision": _rounded(one.precision),
        "recall": _rounded(one.recall),
    }


def _bins_json(bins: Sequence[Bin]) -> list[dict[str, Any]]:
    return [
        {
            "from": one.low,
            "to": None if math.isinf(one.high) else one.high,
            "labels": one.labels,
            "recall": _rounded(one.recall),
        }
        for one in bins
    ]


def show_scores(console: Console, scores: Mapping[str, Score], pictures_per_second: float) -> None:
    """Prints the tables of each camera, or of all pictures, and the speed."""
    for name, one in scores.items():
        if name != "all" or len(scores) == 1:
            _show(console, name, one)
    console.print(f"{pictures_per_second:.0f} pictures a second")


def _show(console: Console, camera: str, score: Score) -> None:
    """Prints the tables of one camera, and a line with the other figures."""
    if camera != "all":
        console.print(f"{camera} camera" if camera == "hand" else f"{camera} cameras")
    figures = [(one.name, one.labels, one.ap50, one.ap50_95, one.precision, one.recall) for one in score.classes]
    labels = sum(one.labels for one in score.classes)
    figures.append(("all", labels, score.map50, score.map50_95, score.precision, score.recall))
    rows = [(name, str(count), *map(_shown, values)) for name, count, *values in figures]
    show_table(console, ("class", "labels", "AP50", "AP50-95", "precision", "recall"), rows)
    for name, bins in (
        ("longer side, px", score.by_size_px),
        ("distance, m", score.by_distance_m),
        ("visibility", score.by_visibility),
    ):
        _show_bins(console, name, bins)
    false = _shown(score.false_per_100_distractor_pictures, digits=1)
    console.print(
        f"{score.pictures} pictures, {score.distractor_pictures} of them with nothing to find: {false} false "
        "detections in a hundred of those"
    )


def _show_bins(console: Console, name: str, bins: Sequence[Bin]) -> None:
    filled = [one for one in bins if one.labels]
    if filled:
        rows = ("labels", *(str(one.labels) for one in filled)), ("recall", *(_shown(one.recall) for one in filled))
        show_table(console, (name, *map(_range, filled)), rows)


def _range(one: Bin) -> str:
    return f"{one.low:g} -" if math.isinf(one.high) else f"{one.low:g} - {one.high:g}"


def _shown(value: float | None, digits: int = 3) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 4)
