"""The table of a spaCy model that gives the row of each word in its vectors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Final

__all__ = ["FREQUENT_WORDS", "WordRows"]

FREQUENT_WORDS: Final = 50_000
"""So many of the words of the model, which are in the order of their frequency, count as English words."""
_SEARCHES: Final = 40  # rare words that are searched for in the file before all of it is read
_MOST_BYTES_OF_ENTRY: Final = 14
_LARGEST_IN_A_BYTE: Final = 0x7F  # msgpack writes these as they are; else a byte gives the length: 0xcc, 0xcd, 0xce
_KEY_OF_64_BITS: Final = b"\xcf"
_MAP_OF_32_BITS: Final = b"\xdf"
_HEADER_BYTES: Final = 5


class WordRows(Mapping[int, int]):
    """Rows of vectors by the hash of a word, read from a msgpack file when they are needed.

    The frequent words are a dictionary. A rarer word is searched for in the bytes of the file, which takes 2 to 3 ms;
    after 40 of those the whole file becomes the dictionary, as for a file of sentences that takes less time.
    """

    def __init__(self, file: Path) -> None:
        self._data = file.read_bytes()
        self._searched: dict[int, int | None] = {}

    @cached_property
    def frequent(self) -> Mapping[int, int]:
        """Rows of the most frequent words, in the order of their frequency."""
        entries = min(FREQUENT_WORDS, len(self))
        return self._unpacked(entries, _HEADER_BYTES + entries * _MOST_BYTES_OF_ENTRY)

    @cached_property
    def _all(self) -> Mapping[int, int]:
        return self._unpacked(len(self), len(self._data))

    def _unpacked(self, entries: int, end: int) -> Mapping[int, int]:
        """The first entries of the file, none of which stands behind the byte `end`."""
        from srsly.msgpack import Unpacker

        unpacker = Unpacker(max_buffer_size=len(self._data), strict_map_key=False)
        unpacker.feed(_MAP_OF_32_BITS + entries.to_bytes(4, "big") + self._data[_HEADER_BYTES:end])
        rows: Mapping[int, int] = unpacker.unpack()
        return rows

    def __getitem__(self, key: int) -> int:
        if "_all" in self.__dict__:
            return self._all[key]
        row = self.frequent.get(key)
        if row is None:
            row = self._rare(key)
        if row is None:
            raise KeyError(key)
        return row

    def _rare(self, key: int) -> int | None:
        """The row of a word that is not frequent; None when it has none."""
        if key not in self._searched:
            if len(self._searched) >= _SEARCHES or key.bit_length() <= 32:  # short keys could be part of a longer one
                return self._all.get(key)
            self._searched[key] = self._found(key)
        return self._searched[key]

    def _found(self, key: int) -> int | None:
        at = self._data.find(_KEY_OF_64_BITS + key.to_bytes(8, "big"))
        if at < 0:
            return None
        first = self._data[at + 9]
        length = first - 0xCB  # 0xcc is followed by 1 byte, 0xcd by 2
        return first if first <= _LARGEST_IN_A_BYTE else int.from_bytes(self._data[at + 10 : at + 10 + length], "big")

    def __iter__(self) -> Iterator[int]:
        return iter(self._all)

    def __len__(self) -> int:
        return int.from_bytes(self._data[1:_HEADER_BYTES], "big")
