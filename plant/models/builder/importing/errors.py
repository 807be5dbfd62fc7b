"""What can go wrong when a mesh is to become a model, told in a sentence."""

from __future__ import annotations


class ObjectImportError(Exception):
    """The file or what is wanted of it cannot be used; the message says why, `hint` what to do."""

    def __init__(self, message: str, hint: str) -> None:
        self.message, self.hint = message, hint
        super().__init__(f"{message}; {hint}")


class ObjectsExtraMissingError(ImportError):
    """A library of the extra `objects` is not installed."""
