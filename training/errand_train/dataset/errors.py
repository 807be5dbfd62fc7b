"""What can go wrong with a data set, told in a sentence."""

from __future__ import annotations


class DatasetError(Exception):
    """The folder or the wishes cannot be used; the message says why, `hint` what to do."""

    def __init__(self, message: str, hint: str) -> None:
        self.message, self.hint = message, hint
        super().__init__(f"{message}; {hint}")
