"""Import of mesh files and photographs: writes a folder that worlds and missions name under `imports`."""

from errand_make.errors import LibraryMissingError, ObjectImportError
from errand_make.objects.import_object import STEPS, ImportOptions, ImportReports, import_object
from errand_make.objects.photographs import import_photographs

__all__ = [
    "STEPS",
    "ImportOptions",
    "ImportReports",
    "LibraryMissingError",
    "ObjectImportError",
    "import_object",
    "import_photographs",
]
