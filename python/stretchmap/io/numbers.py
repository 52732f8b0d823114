"""Rows of numbers in a text file: landmarks, points."""

from __future__ import annotations

import csv
import io
import math
import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.files import open_to_read
from ..base.options import as_path
from ..errors import FileFormatError


def read_numbers(path: str | os.PathLike[str], widths: dict[int, str]) -> NDArray[np.float64]:
    """Read a CSV file of numbers, the same count in each row.

    Parameters
    ----------
    path : path-like
        A first row that is not numbers is a header; empty rows and those that begin with ``#`` are
        passed over.
    widths : dict from int to str
        Numbers of columns that will do, and what they are.

    Returns
    -------
    ndarray, shape (n, w)
        ``n > 0`` rows, ``w`` one of ``widths``.

    Raises
    ------
    FileFormatError
        If the file is not like that; names the line at fault.
    OSError
        If it cannot be opened.
    """
    path = as_path(path)
    lines = _rows(path)
    if lines and not any(_is_number(cell) for cell in lines[0][1]):
        del lines[0]
    wanted = " or ".join(f"{width} numbers ({what})" for width, what in widths.items())
    if not lines:
        raise FileFormatError(f"{path} holds no numbers; every row must hold {wanted}")
    for line, row in lines:
        if len(row) not in widths:
            raise FileFormatError(
                f"{path}, line {line}: {len(row)} entries; every row must hold {wanted}"
            )
        if len(row) != len(lines[0][1]):
            raise FileFormatError(
                f"{path}, line {line}: {len(row)} entries, but {len(lines[0][1])} before"
            )
        for cell in row:
            if not _is_number(cell) or not math.isfinite(float(cell)):
                raise FileFormatError(f"{path}, line {line}: {cell!r} is not a finite number")
    return np.array([row for _, row in lines], float)


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Line number and cells of each row that is neither empty nor a remark."""
    try:
        with open_to_read(path) as binary:
            reader = csv.reader(io.TextIOWrapper(binary, encoding="utf-8-sig", newline=""))
            return [
                (reader.line_num, [cell.strip() for cell in row])
                for row in reader
                if any(cell.strip() for cell in row) and not row[0].lstrip().startswith("#")
            ]
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileFormatError(f"{path} is not a readable CSV file: {error}") from None


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell  # which Python takes between digits
