"""Compressed packets, unpacked to a limit: a damaged length must not fill the memory."""

from __future__ import annotations

import bz2
import io
import re

import lz4.frame
import zstandard

from evplace.core.errors import UnsupportedError
from evplace.sources.readers._source import printable

LIMIT = 1 << 26
"""Bytes that one packet may unpack to; those of real recordings are a few megabytes."""

_NAME = re.compile(r"[A-Za-z][\w.+-]{0,15}")


class UnpackError(Exception):
    """The packet cannot be unpacked; the text says why."""


def unpack(data: bytes, method: str, limit: int = LIMIT) -> bytes | bytearray:
    """`data` unpacked by `method`: "none", "lz4", "zstd" or "bz2".

    UnpackError where it is damaged, UnsupportedError for another method.
    """
    if method == "none":
        return data
    if method not in _METHODS:
        known = ", ".join(_METHODS)
        if not _NAME.fullmatch(method):
            raise UnpackError(f"'{printable(method[:20])}' is the name of no compression")
        raise UnsupportedError(f"the compression '{method}' is not read: known are {known}")
    try:
        whole = _METHODS[method](data, limit)
    except (OSError, EOFError, RuntimeError, ValueError, zstandard.ZstdError) as error:
        raise UnpackError(f"{method} data is damaged: {error}") from error
    if len(whole) > limit:
        raise UnpackError(f"{method} data unpacks to more than {limit >> 20} MiB")
    return whole


def _lz4(data: bytes, limit: int) -> bytes | bytearray:
    unpacker = lz4.frame.LZ4FrameDecompressor()
    step = max(4 * len(data), 1 << 16)
    first: bytes = unpacker.decompress(data, step)
    if unpacker.eof:
        return first
    whole = bytearray(first)
    while not unpacker.eof and not unpacker.needs_input and len(whole) <= limit:
        whole += unpacker.decompress(b"", step)
    if not unpacker.eof and len(whole) <= limit:
        raise EOFError("it ends too early")
    return whole


def _zstd(data: bytes, limit: int) -> bytes:
    if 0 < zstandard.frame_content_size(data) <= limit:  # stated and possible: in one go
        return zstandard.ZstdDecompressor(max_window_size=LIMIT).decompress(data)
    with zstandard.ZstdDecompressor(max_window_size=LIMIT).stream_reader(io.BytesIO(data)) as reader:
        return reader.read(limit + 1)


def _bz2(data: bytes, limit: int) -> bytes:
    unpacker = bz2.BZ2Decompressor()
    whole = unpacker.decompress(data, limit + 1)
    if not unpacker.eof and len(whole) <= limit:
        raise EOFError("it ends too early")
    return whole


_METHODS = {"lz4": _lz4, "zstd": _zstd, "bz2": _bz2}
