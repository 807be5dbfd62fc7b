"""The token of HTTP calls: the one that is given, else one that is made once and kept beside the store."""

from __future__ import annotations

import os
import re
import secrets
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from executive.store.database import STORE_FILE
from skills.files.errors import InputError

__all__ = ["CallToken", "call_token"]

_FORM: Final = re.compile(r"[A-Za-z0-9._~+/=-]{8,512}")


@dataclass(frozen=True)
class CallToken:
    """A token, the file that keeps it (None: it was given), and whether it was made just now."""

    text: str
    file: Path | None = None
    new: bool = False


def call_token(given: str | None, store: Path) -> CallToken:
    """The token for the calls of a store.

    Raises:
        InputError: it is too short or of other characters, or others than its owner can read its file.
    """
    if given is not None:
        return CallToken(_checked(given, None))
    file = store.with_name(f"{store.name}-token")
    with STORE_FILE.failures(store):
        try:
            opened = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        except FileExistsError:
            return CallToken(_kept(file), file)
        text = secrets.token_urlsafe(32)
        with os.fdopen(opened, "w", encoding="ascii") as writer:
            writer.write(f"{text}\n")
    return CallToken(text, file, new=True)


def _kept(file: Path) -> str:
    if stat.S_IMODE(file.stat().st_mode) & (stat.S_IRWXG | stat.S_IRWXO):
        raise InputError("others can read the token", hint=f"chmod 600 {file}, or remove it for a new one", file=file)
    return _checked(file.read_text(encoding="utf-8", errors="replace").strip(), file)


def _checked(text: str, file: Path | None) -> str:
    if not _FORM.fullmatch(text):
        hint = "give at least 8 letters, digits or any of ._~+/=-"
        raise InputError("the token for calls cannot be used", hint=hint, file=file)
    return text
