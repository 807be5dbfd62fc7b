"""The modules that make the reference and the schemas, and the pages that they make."""

import sys

from tests.docs.documents import DOCS

sys.path.insert(0, str(DOCS))
import file_schemas
import make_reference
import mission_constructs
import mission_schema

PAGES = make_reference.pages()
__all__ = ["PAGES", "file_schemas", "make_reference", "mission_constructs", "mission_schema"]
