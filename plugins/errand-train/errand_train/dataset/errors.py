"""The error of a data set that cannot be made."""

from __future__ import annotations


class DatasetError(Exception):
    """A folder or option cannot be used; the message says why, `hint` what to do."""

    def __init__(self, message: str, hint: str) -> None:
        self.message, self.hint = message, hint
        super().__init__(f"{message}; {hint}")
