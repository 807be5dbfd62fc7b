"""The extra `train`, which may be missing."""

from __future__ import annotations

from importlib.util import find_spec

from skills.files.errors import InputError

__all__ = ["needs_torch"]


def needs_torch() -> None:
    """Refuse to go on without torch.

    Raises:
        InputError: the extra `train` is not installed.
    """
    if find_spec("torch") is None:
        raise InputError("training needs torch, which is not installed", hint="pip install 'spot-errand[speech,train]'")
