"""Files of laboratories with changes of their structure, as people and programs that know the
format make them: columns, rows, groups, cells, headers and datasets that are gone, there twice,
elsewhere, or of another kind.
"""

import io
import random
import re
from collections.abc import Callable

import h5py
import numpy as np
import openpyxl

from bayesindent.settings.problem import schema

__all__ = ["restructured"]

#: What a cell or a value may be instead.
CELLS = (
    *("", " ", "n/a", "nan", "inf", "-1", "0", "1e-320", "1e308", "1e999", "1,5", "1.234,5"),
    *("12 GPa", "12 MPa", "3.2 ± 0.1", "1/0", "=A1", "#DIV/0!", "ü µ °", "a\tb", "'", '"', "; ,"),
    *("[1 1 1]", "(hkl)", "10°", "0x10", "1d3", "TRUE", "2024-01-01", "a" * 3000),
)
#: What a variable of a namelist may have instead.
VALUES = (
    *("", ".true.", "''", "'x'", "1", "-1", "0", "1.5", "1e999", "nan", "1, 2, 3", "3*2.0", "2*"),
    *(
        "1,,3",
        "'a', 'b'",
        "'/dev/zero'",
        "'.'",
        "'..'",
        "'none.csv'",
        "(1,2)",
        "1 2 3 /",
        "'it''s'",
    ),
)
HEADERS = ("", "grain", "sd", "Er (MPa)", "phi1", "E", "M", "x", "1", "Mean", "depth_nm", "group")


def change_table(content: bytes, rng: random.Random) -> bytes:
    """A table of text with other columns, rows, cells, marks or encodings."""
    text = content.decode("utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "latin-1")
    mark = max(",;\t", key=text.count)
    rows = [line.split(mark) for line in text.splitlines()]
    width = max(map(len, rows))
    head = next((i for i, row in enumerate(rows) if len(row) == width), 0)
    row, column, other = rng.randrange(len(rows)), rng.randrange(width), rng.randrange(width)
    ending, encoding = "\n", "utf-8"
    match rng.randrange(16):
        case 0:
            rows = [cells[:column] + cells[column + 1 :] for cells in rows]
        case 1:
            rows = [[*cells, *cells[column : column + 1]] for cells in rows]
        case 2:
            for cells in rows:
                if max(column, other) < len(cells):
                    cells[column], cells[other] = cells[other], cells[column]
        case 3:
            rows[head][column] = rng.choice([*HEADERS, rows[head][other]])
        case 4:
            del rows[row]
        case 5:
            rows += rng.choice([1, 3, 500]) * [list(rows[row])]
        case 6:
            rows[row] = rows[row][:column]
        case 7:
            rows[row] += ["7", ""]
        case 8:
            rows = [[*cells[:column], rng.choice(CELLS), *cells[column + 1 :]] for cells in rows]
        case 9:
            rows.insert(row, rows[head])
        case 10:
            rows = [list(cells) for cells in zip(*(cells + width * [""] for cells in rows))]
        case 11:
            mark = rng.choice(",;\t| ")
        case 12:
            encoding = rng.choice(["utf-16", "utf-16-le", "utf-8-sig", "cp1252", "utf-32"])
        case 13:
            ending = rng.choice(["\r\n", "\r", "\n\n", "\x0b", "\u2028", " \n"])
        case 14:
            rows.insert(row, [rng.choice(["", "#", "# a", "--", "mean", "GPa"])] * width)
        case _:
            if column < len(rows[row]):
                rows[row][column] = rng.choice(CELLS)
    return ending.join(mark.join(cells) for cells in [*rows, [""]]).encode(encoding, "replace")


def change_namelist(content: bytes, rng: random.Random) -> bytes:
    """A namelist with other groups, variables and values."""
    lines = content.decode().splitlines()
    chosen = [i for i, line in enumerate(lines) if re.match(r"\s*\w+ *=", line)] or [0]
    begins = [i for i, line in enumerate(lines) if line.startswith("&")] or [0]
    i, first = rng.choice(chosen), rng.choice(begins)
    last = next((k for k in range(first, len(lines)) if lines[k].strip().endswith("/")), first)
    name, _, value = lines[i].partition("=")
    stated = rng.choice(schema())
    match rng.randrange(11):
        case 0:
            del lines[first : last + 1]
        case 1:
            lines += lines[first : last + 1]
        case 2:
            lines[first] = f"&{stated.group}"
        case 3:
            lines.insert(rng.randrange(len(lines)), lines.pop(i))
        case 4:
            lines.insert(i, f"{name}= {rng.choice(VALUES)}")
        case 5:
            lines[i] = f"{name}= {rng.choice(VALUES)}"
        case 6:
            lines[i] = f"  {stated.name} ={value}"
        case 7:
            lines.insert(first + 1, f"  {stated.name} = {rng.choice([*VALUES, stated.default])}")
        case 8:
            lines += [f"&{stated.group} {stated.name} = {rng.choice(VALUES)} /"]
        case 9:
            lines[i] = f"{name}({rng.choice(['1', '0', '3', ':', '1:2', '-1', 'x'])}) ={value}"
        case _:
            del lines[last]
    return "\n".join([*lines, ""]).encode()


def change_spreadsheet(content: bytes, rng: random.Random) -> bytes:
    """A spreadsheet with other sheets, and cells of other kinds."""
    book, file = openpyxl.load_workbook(io.BytesIO(content)), io.BytesIO()
    sheet = book.active
    row, column = rng.randint(1, sheet.max_row), rng.randint(1, sheet.max_column)
    match rng.randrange(10):
        case 0:
            sheet.delete_rows(row, rng.choice([1, 5, 100]))
        case 1:
            sheet.delete_cols(column)
        case 2:
            sheet.insert_rows(row, rng.choice([1, 30]))
        case 3:
            sheet.insert_cols(column)
        case 4:
            sheet.merge_cells(
                start_row=row, start_column=column, end_row=row + 2, end_column=column + 2
            )
        case 5:
            sheet.cell(rng.choice([row, 1_048_576]), rng.choice([column, 16_384])).value = 1.0
        case 6:
            book.create_sheet(rng.choice(["a", "x" * 31]), rng.choice([0, 1]))
        case 7:
            sheet.sheet_state = "hidden"
            book.create_sheet("empty")
        case 8:
            book.copy_worksheet(sheet)
        case _:
            values = (*CELLS[1:], True, None, 10**30, 1e308, "=SUM(A1:A9)", "=1/0")
            sheet.cell(row, column).value = rng.choice(values)
    book.save(file)
    return file.getvalue()


def change_map(content: bytes, rng: random.Random) -> bytes:
    """A map of text: header or points in other numbers, kinds and places."""
    lines = content.decode("latin-1").splitlines()
    i, k = rng.randrange(len(lines)), rng.randrange(len(lines))
    words = re.split(r"(\s+)", lines[i])
    w = rng.randrange(len(words))
    match rng.randrange(7):
        case 0:
            del lines[i]
        case 1:
            lines.insert(k, lines[i])
        case 2:
            lines[i], lines[k] = lines[k], lines[i]
        case 3:
            lines[i] = "".join(words[:w])
        case 4:
            number = rng.choice(["0", "-1", "2", "1e9", "nan", "999999999999", "x", "0.1"])
            lines[i] = re.sub(r"-?\d+\.?\d*", number, lines[i], count=1)
        case 5:
            lines = lines[: max(1, i)]
        case _:
            words[w] = rng.choice(CELLS)
            lines[i] = "".join(words)
    return "\n".join([*lines, ""]).encode("latin-1", "replace")


def change_hdf5(content: bytes, rng: random.Random) -> bytes:
    """A file of HDF5 whose datasets are gone, elsewhere, or of other shapes and kinds."""
    file = io.BytesIO(content)
    with h5py.File(file, "r+") as root:
        names: list[str] = []
        root.visit(names.append)
        name = rng.choice(names)
        old = root[name][()] if isinstance(root[name], h5py.Dataset) else 0
        del root[name]
        match rng.randrange(9):
            case 0:
                pass
            case 1:
                root[f"{name}x"] = old
            case 2:
                root[name] = np.zeros((0,))
            case 3:
                root[name] = "text"
            case 4:
                root[name] = np.full(np.shape(old), np.nan)
            case 5:
                root[name] = np.ravel(old)[:-1] if np.size(old) > 1 else [old, old]
            case 6:
                root[name] = h5py.SoftLink(f"/{name}")
            case 7:
                root[name] = h5py.ExternalLink("/etc/passwd", "/")
            case _:
                root.create_group(name)
    return file.getvalue()


#: The change of a file by its ending; that of other files is of tables.
BY_ENDING: dict[str, Callable[[bytes, random.Random], bytes]] = {
    ".nml": change_namelist,
    ".xlsx": change_spreadsheet,
    ".ctf": change_map,
    ".ang": change_map,
    ".h5": change_hdf5,
}


def restructured(content: bytes, ending: str, rng: random.Random) -> bytes:
    """The content of a file with this ending, with one change of its structure or a few."""
    for _ in range(rng.choice([1, 1, 2, 3])):
        content = BY_ENDING.get(ending, change_table)(content, rng)
    return content
