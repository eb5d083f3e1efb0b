"""Decimal numbers in rows of text, read exactly: whole part and billionths as two integers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit

NEWLINE, RETURN, MINUS, PLUS, DOT = ord("\n"), ord("\r"), ord("-"), ord("+"), ord(".")
HASH, PERCENT = ord("#"), ord("%")
TRUE, FALSE, ON, OFF = (np.frombuffer(word, np.uint8) for word in (b"true", b"false", b"on", b"off"))
"""Words for 1 and 0, in capitals or not."""
DIGITS = 18
"""Digits that 64 bits hold; further ones are beyond any clock."""
TENS = 10 ** np.arange(DIGITS + 1, dtype=np.int64)


@njit(cache=True)
def parse(
    text: NDArray[np.uint8], columns: int, rows: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], int, int]:
    """Up to `rows` rows of `columns` numbers; the text must end with a newline.

    Returns whole parts and billionths, (N, columns) each, the bytes used and the lines seen; it stops before
    the first line that is neither empty, nor a remark (# or %), nor such a row.
    """
    whole, fraction = np.empty((rows, columns), np.int64), np.empty((rows, columns), np.int64)
    count, i, lines = 0, 0, 0
    while i < len(text) and count < rows:
        taken, i = _plain_rows(text, i, columns, whole[count:], fraction[count:])
        count, lines = count + taken, lines + taken
        if i == len(text) or count == rows:
            break
        numbers, end = _row(text, i, columns, whole[count], fraction[count])
        if numbers != columns and numbers != 0:
            break
        count, lines, i = count + (numbers == columns), lines + 1, end
    return whole[:count], fraction[:count], i, lines


@njit(cache=True)
def _plain_rows(
    text: NDArray[np.uint8],
    start: int,
    columns: int,
    whole: NDArray[np.int64],
    fraction: NDArray[np.int64],
) -> tuple[int, int]:
    """Rows as nearly all are, at four times the speed of `_row`; stops before one that is not so.

    One blank stands between two numbers, which are short and without exponent. As the text ends with a
    newline, no look at its end is needed.
    """
    row, i = 0, start
    while row < len(whole) and i < len(text):
        begin = i
        for column in range(columns):
            negative = text[i] == MINUS
            i += negative
            first, value, part, places = i, np.int64(0), np.int64(0), 0
            digit = np.int64(text[i]) - 48
            while 0 <= digit <= 9:
                value = value * 10 + digit
                i += 1
                digit = np.int64(text[i]) - 48
            digits = i - first
            if text[i] == DOT:
                i += 1
                first = i
                digit = np.int64(text[i]) - 48
                while 0 <= digit <= 9:
                    part = part * 10 + digit
                    i += 1
                    digit = np.int64(text[i]) - 48
                places = i - first
            i += column == columns - 1 and text[i] == RETURN
            fits = 0 < digits + places < DIGITS and places <= 9
            if not fits or not (_blank(text[i]) if column < columns - 1 else text[i] == NEWLINE):
                return row, begin
            part *= TENS[9 - places]
            whole[row, column] = -value - (part > 0) if negative else value
            fraction[row, column] = 1_000_000_000 - part if negative and part > 0 else part
            i += 1
        row += 1
    return row, i


@njit(cache=True)
def _row(
    text: NDArray[np.uint8],
    start: int,
    columns: int,
    whole: NDArray[np.int64],
    fraction: NDArray[np.int64],
) -> tuple[int, int]:
    """How many numbers the line at `start` has (-1 where it is no row or remark), and the byte after it."""
    i, column, size = start, 0, len(text)
    while i < size and text[i] != NEWLINE:
        if _blank(text[i]):
            i += 1
        elif (text[i] == HASH or text[i] == PERCENT) and column == 0:
            while i < size and text[i] != NEWLINE:
                i += 1
        elif column == columns:
            return -1, start
        else:
            end, whole[column], fraction[column] = _number(text, i)
            if end == i or (end < size and text[end] != NEWLINE and not _blank(text[end])):
                return -1, start
            i = end
            column += 1
    return column, min(i + 1, size)


@njit(cache=True)
def _blank(byte: int) -> bool:
    """Space, tab, carriage return, comma, semicolon or a mark of quotation."""
    separates = byte == 32 or byte == 9 or byte == 13 or byte == 44 or byte == 59
    return separates or byte == 34 or byte == 39


@njit(cache=True)
def _spells(text: NDArray[np.uint8], start: int, word: NDArray[np.uint8]) -> bool:
    """Whether a word stands at `start`, in capitals or not."""
    end = start + len(word)
    return bool(end <= len(text) and np.all(text[start:end] | 32 == word))


@njit(cache=True)
def _word(text: NDArray[np.uint8], start: int) -> tuple[int, int, int]:
    """As `_number`, of a word that stands for 1 or 0."""
    if _spells(text, start, TRUE):
        return start + len(TRUE), 1, 0
    if _spells(text, start, FALSE):
        return start + len(FALSE), 0, 0
    if _spells(text, start, ON):
        return start + len(ON), 1, 0
    if _spells(text, start, OFF):
        return start + len(OFF), 0, 0
    return start, 0, 0


@njit(cache=True)
def _number(text: NDArray[np.uint8], start: int) -> tuple[int, int, int]:
    """The end of the number at `start` (or `start` where there is none), its whole part and billionths."""
    i, size = start, len(text)
    if text[i] > 57:
        end, value, none = _word(text, i)
        return end, value, none
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
