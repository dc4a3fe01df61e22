"""Convert curves in files of instruments to the neutral CSV that the core reads."""

import re
from collections.abc import Iterable
from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd

from ..core import InputError, located
from .cells import usual
from .other_files import decoded, reader_of, reading

#: Columns of a curve; the last one only if the stiffness was measured.
COLUMNS = ("time_s", "depth_nm", "load_mn", "stiffness_n_m")
#: Numbers above this mean a missing value: instruments write 1.797e308.
NO_VALUE = 1e300
UNITS = {"time (s)": 1.0, "depth (nm)": 1.0, "load (mn)": 1.0}
UNITS |= dict.fromkeys(("depth (µm)", "depth (um)"), 1e3)
UNITS |= dict.fromkeys(("load (µn)", "load (un)"), 1e-3)


def curves_of_files(folder: Path, names: Iterable[str], drift_removed: bool) -> dict[str, list]:
    """The columns of the neutral CSV for files of a folder; a name such as 'raw/*.txt' stands for
    several files.
    """
    frames = []
    for name in names:
        with located(name), reading("is no pattern of file names"):
            is_pattern = set(name) & set("*?[") and not Path(name).is_absolute()
            paths = sorted(folder.glob(name)) if is_pattern else [folder / name]
        if not paths:
            raise InputError("there is no such file", name)
        for file in paths:
            shown = file.relative_to(folder) if file.is_relative_to(folder) else file
            with located(shown), reading("is no file of curves that can be read"):
                for test, curve in read_file(file):
                    frames.append(pd.DataFrame({"test": test} | dict(zip(COLUMNS, curve))))
                beside = file.with_suffix(".tdm")
                settings = tdm_settings(beside) if beside.is_file() else {}
            if drift_removed and not settings.get("drift_removed", True):
                raise InputError(
                    f"the drift of {settings.get('drift_nm_s')} nm/s is still in the depths; state "
                    "drift_removed = .false., and drift_nm_s in the table of tests",
                    f"{shown} ({beside.name})",
                )
    # The columns that all curves have.
    table = pd.concat(frames, join="inner")
    return table[(table.drop(columns="test").abs() < NO_VALUE).all(axis=1)].to_dict("list")


def read_file(file: Path) -> list[tuple[str, tuple]]:
    """Names and curves (`COLUMNS`) of the tests of a file."""
    try:
        text = usual(decoded(file.read_bytes())[0]) if file.suffix.lower() == ".txt" else ""
    except OSError as error:
        raise InputError(f"{error.strerror}") from None
    if any(line.startswith("Depth (") for line in text.splitlines()):
        return [(file.stem, read_hysitron(text))]
    if file.suffix.lower() == ".hld":
        nanodent = reader_of(file, "a .hld file", "nanodent", ", or export the curve as .txt")
        data = nanodent.load_experiment(file).trace
        return [(file.stem, (data["time_s"], data["disp_nm"], data["force_uN"] / 1e3))]
    reader = reader_of(
        file,
        f"this {file.suffix} file",
        "micromechanics.indentation",
        ", or write its columns to a CSV",
    )
    data, tests = reader.Indentation(str(file), output={"verbose": 0}), []
    while len(data.raw.h):
        # The units of the package are um, mN and, for a continuous stiffness, mN/um.
        curve, valid = (
            np.array([data.raw.t, 1e3 * data.raw.h, data.raw.p], dtype=float),
            np.asarray(data.raw.valid, dtype=bool),
        )
        if data.method.name == "CSM" and len(data.raw.slope) == np.count_nonzero(valid):
            curve = np.vstack([curve[:, valid], 1e3 * data.raw.slope])
        tests.append((str(data.testName or file.stem), tuple(curve)))
        if not data.testList or not data.nextTest():
            break
    if not tests:
        raise InputError("micromechanics finds no curve in it; write its columns to a CSV")
    return tests


def read_hysitron(text: str) -> tuple:
    """A curve that a Hysitron TI 990 exported: text whose lines end in CR."""
    lines = text.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("Depth ("))
    table = pd.read_csv(StringIO("\n".join(lines[start:])), sep="\t")
    columns = {name.split()[0]: name for name in map(str.lower, table) if name in UNITS}
    if set(columns) != {"time", "depth", "load"}:
        raise InputError(
            f"line {start + 1}: the columns Depth, Load and Time are needed, in {', '.join(UNITS)}"
        )
    stated = next(map(int, re.findall(r"Number of Points = *(\d{1,9})\b", text)), len(table))
    if stated != len(table):
        raise InputError(f"{len(table)} points, where the file states {stated}; it is truncated")
    table.columns = table.columns.str.lower()
    names = (columns[word] for word in ("time", "depth", "load"))
    return tuple(table[name].to_numpy(float) * UNITS[name] for name in names)


def tdm_settings(file: Path) -> dict[str, float]:
    """The rate of the drift of the curve of a .tdm file, and whether it was removed (1 or 0)."""
    text = file.read_text(encoding="utf-8", errors="replace")
    names = {"drift_nm_s": "Drift_Rate__nm___s__", "drift_removed": "Drift_Correction"}
    found = {key: re.search(rf'name="Current_{n}">([^<]*)<', text) for key, n in names.items()}
    values = {key: float(match[1]) for key, match in found.items() if match}
    return {key: value for key, value in values.items() if abs(value) < NO_VALUE}
