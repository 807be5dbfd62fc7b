"""Import of mesh files and photographs: writes a folder that worlds and missions name under `imports`."""

from plant.models.builder.importing.import_object import STEPS, ImportOptions, ImportReports, import_object
from plant.models.builder.importing.photographs import import_photographs
from plant.models.catalogue import ObjectImportError, ObjectsExtraMissingError

__all__ = [
    "STEPS",
    "ImportOptions",
    "ImportReports",
    "ObjectImportError",
    "ObjectsExtraMissingError",
    "import_object",
    "import_photographs",
]
