"""Convert curves in files of instruments to the neutral CSV that the core reads."""

import os
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ..core import InputError, located
from .other_files import reader_of, reading

#: Columns of a curve; the last one only if the stiffness was measured.
COLUMNS = ("time_s", "depth_nm", "load_mn", "stiffness_n_m")
#: Numbers above this mean a missing value: instruments write 1.797e308.
NO_VALUE = 1e300
UNITS = {"time (s)": 1.0, "depth (nm)": 1.0, "depth (µm)": 1e3, "load (mn)": 1.0, "load (µn)": 1e-3}


def curves_of_files(folder: Path, names: Iterable[str], drift_removed: bool) -> dict[str, list]:
    """The columns of the neutral CSV for files of a folder; a name such as 'raw/*.txt' stands for
    several files.
    """
    found = []
    for name in names:
        with located(name), reading("is no pattern of file names"):
            paths = (
                sorted(folder.glob(name))
                if set(name) & set("*?[") and not Path(name).is_absolute()
                else [folder / name]
            )
        if not paths:
            raise InputError("there is no such file", name)
        for file in paths:
            shown = file.relative_to(folder) if file.is_relative_to(folder) else file
            with located(shown), reading("is no file of curves that can be read"):
                for test, curve in read_file(file):
                    found.append((test, np.asarray(curve, dtype=float)))
                beside = file.with_suffix(".tdm")
                settings = tdm_settings(beside) if beside.is_file() else {}
            if drift_removed and not settings.get("drift_removed", True):
                raise InputError(
                    f"the drift of {settings.get('drift_nm_s')} nm/s is still in the depths; state "
                    "drift_removed = .false., and drift_nm_s in the table of tests",
                    f"{shown} ({beside.name})",
                )
    names = COLUMNS[: min(len(curve) for _, curve in found)]
    tests = np.repeat([test for test, _ in found], [curve.shape[1] for _, curve in found])
    values = np.hstack([curve[: len(names)] for _, curve in found])
    whole = np.abs(values).max(axis=0) < NO_VALUE
    return {"test": tests[whole].tolist()} | dict(zip(names, values[:, whole].tolist()))


def read_file(file: Path) -> list[tuple[str, tuple]]:
    """Names and curves (`COLUMNS`) of the tests of a file."""
    try:
        text = file.read_bytes().decode("latin-1") if file.suffix.lower() == ".txt" else ""
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
    names = [name.strip().lower() for name in lines[start].split("\t")]
    order = [
        (j, UNITS[name])
        for word in ("time", "depth", "load")
        for j, name in enumerate(names)
        if name in UNITS and name.startswith(word)
    ]
    if len(order) != 3:
        raise InputError(
            f"line {start + 1}: the columns Depth, Load and Time are needed, in {', '.join(UNITS)}"
        )
    rows = []
    for number, line in enumerate(filter(str.strip, lines[start + 1 :]), start + 2):
        try:
            cells = line.split("\t")
            rows.append([float(cells[j]) * scale for j, scale in order])
        except (ValueError, IndexError):
            raise InputError(f"line {number}: {line[:40]!r} is no row of numbers") from None
    stated = next(map(int, re.findall(r"Number of Points = *(\d{1,9})\b", text)), len(rows))
    if stated != len(rows):
        raise InputError(f"{len(rows)} points, where the file states {stated}; it is truncated")
    return tuple(np.transpose(rows))


def tdm_settings(file: str | os.PathLike) -> dict[str, float | bool]:
    """The corrections that the instrument made to the curve of a .tdm file: drift_nm_s,
    compliance_nm_mn, and whether the drift was removed.
    """
    text = Path(file).read_text(encoding="utf-8", errors="replace")
    names = {
        "drift_nm_s": "Drift_Rate__nm___s__",
        "compliance_nm_mn": "Machine_Compliance__nm___mN__",
        "drift_removed": "Drift_Correction",
    }
    found: dict[str, float | bool] = {}
    for key, name in names.items():
        match = re.search(rf'name="Current_{name}">([^<]*)<', text)
        if match and abs(value := float(match[1])) < NO_VALUE:
            found[key] = bool(value) if key == "drift_removed" else value
    return found
