"""Text as bytes that end their lines with a newline, whatever encoding and line ends its file has."""

from __future__ import annotations

import codecs
import gzip
import zipfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Protocol

HEAD = 1 << 14
"""Bytes from which encoding and line ends are told."""
WIDE = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
"""The marks at the start of text of two bytes a sign."""


class Stream(Protocol):
    """What can be read from its start to its end."""

    def read(self, size: int, /) -> bytes:
        """The next bytes, about `size`; none at the end."""


def encoding(head: bytes) -> str | None:
    """The encoding of text of two bytes a sign; None for text that has newlines and digits as ASCII has."""
    if head[:2] in WIDE:
        return WIDE[head[:2]]
    low, high = head[0:1024:2], head[1:1024:2]
    if len(high) > 8 and 10 * high.count(0) > 9 * len(high) and 0 not in low:
        return "utf-16-le"
    return "utf-16-be" if len(low) > 8 and 10 * low.count(0) > 9 * len(low) and 0 not in high else None


def is_text(head: bytes) -> bool:
    """Whether bytes may be text: none of them is a code for control, but for tabs and ends of lines."""
    if encoding(head) is not None:
        return True
    return bool(head) and not head.translate(None, bytes(range(32, 256)) + b"\t\n\r\f\v").strip(b"\x1a")


@contextmanager
def opened(path: Path, member: str | None = None) -> Generator[Stream, None, None]:
    """A file's text, unpacked where it is; of a zip archive, that of a member."""
    with path.open("rb") as file:
        magic = file.read(2)
    if magic == b"\x1f\x8b":
        with gzip.open(path) as packed, gzip.open(path) as again:
            yield _plain(packed, again.read(HEAD))  # type: ignore[arg-type]  # reads like any binary file
    elif magic == b"PK" and member is not None:
        with zipfile.ZipFile(path) as archive, archive.open(member) as inner, archive.open(member) as again:
            yield _plain(inner, again.read(HEAD))
    else:
        with path.open("rb") as file, path.open("rb") as again:
            yield _plain(file, again.read(HEAD))


def _plain(file: IO[bytes], head: bytes) -> Stream:
    """The file itself, where it needs no change."""
    wide = encoding(head)
    if wide is None and head.startswith(codecs.BOM_UTF8):
        file.read(len(codecs.BOM_UTF8))
    text = head.decode(wide, "replace") if wide else head.decode("latin-1")
    old = "\r" in text and "\n" not in text
    return _Changed(file, wide, old) if wide or old else file


class _Changed:
    """Another encoding, or lines that end with a carriage return alone."""

    def __init__(self, file: IO[bytes], wide: str | None, old: bool) -> None:
        self._file = file
        self._decoder = codecs.getincrementaldecoder(wide or "latin-1")("replace")
        self._plain = "utf-8" if wide else "latin-1"
        self._old = old

    def read(self, size: int, /) -> bytes:
        """The next bytes."""
        while data := self._file.read(size):
            if text := self._decoder.decode(data):
                return (text.replace("\r", "\n") if self._old else text).encode(self._plain)
        return self._decoder.decode(b"", final=True).encode(self._plain)
