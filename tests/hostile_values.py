"""Values that break readers: one list for files, options, texts, answers and plug-ins alike."""

from __future__ import annotations

from typing import Any, Final

TEXTS: Final[tuple[str, ...]] = (
    "", " ", "\t", "\n", "a\nb", "a\r\nb", "\x00", "\x07", "\x1b[31mred", "\x7f", "\x85", "\xa0", "\u200b", "\u202eabc",
    "\u2028", "\ufeff", "\ufffe", "\ud800", "\udfff", "\U0010ffff", "🙂", "e\u0301" * 50, "Ａ", "ß", "İ",
    "x" * 300, "x" * 15_000, "9" * 400, "9" * 5_000, "(" * 15_000, "[" * 15_000, "{" * 200, "not " * 5_000,
    "1" + "+1" * 3_000, "'a' * 9", "1 / 0", "9 ** 9 ** 9", "count >", "count + 1", "{count}", "{", "}", "{0.__class__}",
    "${room}", "${", "$${room}", "%s%n", "$(reboot)", "`id`", "'", '"', "\\", "'; DROP TABLE runs; --", "<script>",
    "&amp;", "]]>", "&lol;", "../x.yaml", "/etc/passwd", "/dev/zero", "~", ".", "..", "-", "--help", "con", "a/b", "*",
    "http://localhost/x.sdf", "file:///etc/passwd", "package://nobody/x.sdf", "C:\\x", "__import__('os')",
    "null", "true", "yes", "NO", "010", "0x1F", "1_000", "14:30", "24:00", "2026-01-01", "1e400", "nan", ".inf", "-0",
    "1,5", "0,3", "3 m", "90 deg", "2 min", "PT5M", "P99999999Y", "kitchen", "mars", "start", "beer", "dock",
    "battery < 0.3", "holding", "people in hall",
)  # fmt: skip
"""Control letters, halves of letters, endless texts, expressions, paths, addresses, and what YAML reads as no text."""

NUMBERS: Final[tuple[float, ...]] = (
    0, -0.0, 1, -1, 0.5, 3.5, 1e-12, 90, 360, 255, 256, 65_536, 2**31, 2**63, -(2**63), 10**9, 10**40, 10**400, 1e300,
    5e-324, float("inf"), float("-inf"), float("nan"),
)  # fmt: skip
"""Numbers that are out of any range, or that no arithmetic keeps."""

DATA: Final[tuple[Any, ...]] = (
    None, True, False, *NUMBERS, *TEXTS, b"\x00\xff", [], {}, [[]], [None], [{}], [[[[[[[[]]]]]]]], {"a": 1}, {"": 1},
    {1: 2}, {True: []}, {None: None}, {0.5: 1}, ["dock"], [{"to": "hall"}], {"times": 2}, {"expression": "true"},
    {"all": ["holding"]}, {"answer": "count"}, [0] * 5_000, {str(n): n for n in range(2_000)}, [1, 2], [1, 2, 3],
    [float("nan")] * 3, ["0", "0", "0"], {"x": 1e300, "y": 0, "yaw": 0},
)  # fmt: skip
"""What may stand where a file or an answer holds data."""

FILES: Final[tuple[bytes, ...]] = (
    b"", b"\n", b"\x00" * 100, b"\xff\xfe\x00\x00", b"\xef\xbb\xbf", "name: ä".encode("utf-16"),
    "name: ä".encode("latin-1"),
    b"---\n", b"...\n", b"# nothing\n", b"null\n", b"[]\n", b"3\n", b"text\n", b"{}\n", b"a: 1\na: 2\n", b"a: *x\n",
    b"a: &x [*x]\n", b"a: !!python/object/apply:os.system [id]\n", b"a: !x 1\n", b"%TAG ! x\n", b"a: 1\n---\nb: 2\n",
    b"a:\n\tb: 1\n", b"? [a, b]\n: 1\n", b"? {a: b}\n: 1\n", b"a: b: c\n", b"[" * 5_000 + b"]" * 5_000,
    b"a: " + b"9" * 5_000,
    b"- " * 3_000 + b"x", b"a: &a [x, x]\n" + b"".join(b"%c: &%c [*%c, *%c, *%c, *%c, *%c, *%c, *%c, *%c]\n"
                                                          % (n, n, *[n - 1] * 8) for n in b"bcdefghijklm"),
    b"a: &a {k: v}\nb:\n  <<: *a\n", b"<<: 1\n", b"<<: {<<: {<<: {}}}\n", b"x: " + b"y" * 2_000_000,
    b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n", b"PK\x03\x04", b"\x89PNG\r\n\x1a\n",
    b"P5\n999999999 999999999\n255\n", b"<!DOCTYPE html><html>404</html>", b"<?xml version='1.0'?><sdf/>",
)  # fmt: skip
"""Whole files that are no such file, in no matter what format it should be."""
