"""What the processor can do that matters to networks which are quantised to INT8."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Final

_CPU_INFO: Final = Path("/proc/cpuinfo")
_ABLE: Final = frozenset({"avx512_vnni", "avx_vnni"})


@cache
def adds_byte_products_exactly(cpu_info: Path = _CPU_INFO) -> bool:
    """Whether the processor adds products of bytes in 32 bits at once (VNNI), by what Linux tells of it.

    Where it does not, or nothing is told, ONNX Runtime's quickest way adds two of them in 16 bits first, and cuts off
    what is too large.
    """
    try:
        lines = cpu_info.read_text(encoding="utf-8").splitlines()
    except OSError:
        return False
    flags = [line.partition(":")[2].split() for line in lines if line.startswith("flags")]
    return bool(flags) and all(_ABLE.intersection(able) for able in flags)
