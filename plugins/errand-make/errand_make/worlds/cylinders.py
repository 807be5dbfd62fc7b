"""Files of upright cylinders in the format of BARN worlds."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from skills.inputs.errors import InputError
from skills.inputs.outside import read_text
from skills.inputs.schema import first_error
from skills.quantities import Angle, Coordinate, Opening

MAX_BYTES: Final = 20_000_000


class Cylinders(BaseModel):
    """File of cylinders: x, y, radius and height of each; start (x, y, yaw) and goal (x, y). In metres and radians."""

    model_config = ConfigDict(allow_inf_nan=False)

    cylinders: tuple[tuple[Coordinate, Coordinate, Opening, Opening], ...] = Field(min_length=1, max_length=20_000)
    start: tuple[Coordinate, Coordinate, Angle] | None = None
    goal: tuple[Coordinate, Coordinate] | None = None


def read_cylinders(path: Path) -> Cylinders:
    """Reads a file of cylinders. Raises InputError."""
    text = read_text(path, most_bytes=MAX_BYTES, hint="check the path")
    try:
        return TypeAdapter(Cylinders).validate_python(json.loads(text))
    except json.JSONDecodeError as error:
        raise InputError(f"damaged JSON, {error.msg}", hint="correct it there", file=path, line=error.lineno) from error
    except ValidationError as error:
        where, what, hint = first_error(error.errors())
        form = "it must have 'cylinders': [[x, y, radius, height], ...]"
        raise InputError(f"{'.'.join(map(str, where)) or 'it'}: {what}; {hint}", hint=form, file=path) from error
    except (ValueError, RecursionError) as error:
        what = "it is nested too deep" if isinstance(error, RecursionError) else "a number in it is too long"
        raise InputError(what, hint="correct it", file=path) from error
