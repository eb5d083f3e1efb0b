"""Decimal numbers in rows of text, read exactly: whole part and billionths as two integers."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

NEWLINE, MINUS, PLUS, DOT, HASH = ord("\n"), ord("-"), ord("+"), ord("."), ord("#")
DIGITS = 18
"""Digits that 64 bits hold; further ones are beyond any clock."""
TENS = 10 ** np.arange(DIGITS + 1, dtype=np.int64)


@njit(cache=True)
def parse(
    text: NDArray[np.uint8], columns: int, rows: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], int, int]:
    """Up to `rows` rows of `columns` numbers; the text must end with a newline.

    Returns whole parts and billionths, (N, columns) each, the bytes used and the lines seen; it stops before
    the first line that is neither empty, nor a remark (#), nor such a row.
    """
    whole, fraction = np.empty((rows, columns), np.int64), np.empty((rows, columns), np.int64)
    count, i, lines, size = 0, 0, 0, len(text)
    while i < size and count < rows:
        start, column, good = i, 0, True
        while i < size and text[i] != NEWLINE:
            if _blank(text[i]):
                i += 1
            elif text[i] == HASH and column == 0:
                while i < size and text[i] != NEWLINE:
                    i += 1
            elif column == columns:
                good = False
                break
            else:
                end, whole[count, column], fraction[count, column] = _number(text, i)
                if end == i or (end < size and text[end] != NEWLINE and not _blank(text[end])):
                    good = False
                    break
                i = end
                column += 1
        if not good or (column != columns and column != 0):
            return whole[:count], fraction[:count], start, lines
        count += column == columns
        lines += 1
        i += 1
    return whole[:count], fraction[:count], min(i, size), lines


@njit(cache=True)
def _blank(byte: int) -> bool:
    """Space, tab, carriage return, comma or semicolon."""
    return byte == 32 or byte == 9 or byte == 13 or byte == 44 or byte == 59


@njit(cache=True)
def _number(text: NDArray[np.uint8], start: int) -> tuple[int, int, int]:
    """The end of the number at `start` (or `start` where there is none), its whole part and billionths."""
    i, size = start, len(text)
    negative = text[i] == MINUS
    i += text[i] == MINUS or text[i] == PLUS
    digits, power, seen, after_dot = np.int64(0), 0, 0, False
    while i < size and (48 <= text[i] <= 57 or (text[i] == DOT and not after_dot)):
        if text[i] == DOT:
            after_dot = True
        else:
            seen += 1
            if digits < 10 ** (DIGITS - 1):
                digits = digits * 10 + text[i] - 48
                power -= after_dot
            else:
                power += not after_dot
        i += 1
    if seen == 0:
        return start, 0, 0
    if i + 1 < size and (text[i] == 101 or text[i] == 69):  # e or E
        sign = -1 if text[i + 1] == MINUS else 1
        j = i + 1 + (text[i + 1] == MINUS or text[i + 1] == PLUS)
        exponent, first = 0, j
        while j < size and 48 <= text[j] <= 57:
            exponent = min(exponent * 10 + text[j] - 48, 1000)
            j += 1
        if j > first:
            i, power = j, power + sign * exponent
    whole, fraction = _split(digits, power)
    if negative:
        return i, -whole - (fraction > 0), (1_000_000_000 - fraction) % 1_000_000_000
    return i, whole, fraction


@njit(cache=True)
def _split(digits: int, power: int) -> tuple[int, int]:
    """The whole part and the billionths of digits * 10 ** power; what is too great stops near 10 ** 18."""
    if power >= 0:
        fits = power <= DIGITS and digits <= TENS[DIGITS] // TENS[min(power, DIGITS)]
        return (digits * TENS[power] if fits else TENS[DIGITS] * (digits > 0)), 0
    places = -power
    whole = digits // TENS[places] if places <= DIGITS else 0
    rest = digits - whole * TENS[places] if places <= DIGITS else digits
    if places <= 9:
        return whole, rest * TENS[9 - places]
    return whole, (rest // TENS[places - 9] if places - 9 <= DIGITS else 0)
