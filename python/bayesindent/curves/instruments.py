"""Curves in the files of instruments, as the neutral CSV that the core reads."""

import os
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ..common.result_files import as_csv
from ..core import InputError
from ..settings.laboratory_tables import reader_of

__all__ = ["as_file", "read_curves", "tdm_settings"]

HEADER = "test,time_s,depth_nm,load_mn"
#: Numbers above this are none: instruments write 1.797e308.
NO_VALUE = 1e300
UNITS = {"time (s)": 1.0, "depth (nm)": 1.0, "depth (µm)": 1e3, "load (mn)": 1.0, "load (µn)": 1e-3}


def read_curves(curves, folder: Path, origin: str) -> str:
    """The path of a CSV of curves: itself, or written to `folder` from files of instruments or from a table."""
    if isinstance(curves, str | os.PathLike) and Path(curves).suffix.lower() == ".csv":
        return str(Path(curves).absolute())
    if isinstance(curves, str | os.PathLike):
        curves = [curves]
    path = folder / "curves.csv"
    if not isinstance(curves, list | tuple):
        return as_file(curves, path)
    lines = [HEADER]
    for file in map(Path, curves):
        for name, (time, depth, load) in read_file(file, f"{origin}: {file}: "):
            whole = np.abs([time, depth, load]).max(axis=0) < NO_VALUE
            lines += [f"{name},{t!r},{h!r},{p!r}" for t, h, p in np.transpose([time, depth, load])[whole].tolist()]
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def as_file(table, path: Path) -> str:
    """The file of a table, written to `path` where it is none."""
    if isinstance(table, str | os.PathLike):
        return str(Path(table).absolute())
    columns = {str(name): list(table[name]) for name in table}
    blank = [["" if value is None or value != value else value for value in values] for values in columns.values()]
    path.write_text(as_csv(list(columns), zip(*blank, strict=True)))
    return str(path)


def read_file(file: Path, place: str) -> Iterable[tuple[str, tuple]]:
    """Names and curves (s, nm, mN) of the tests of a file."""
    if file.suffix.lower() == ".txt":
        return [(file.stem, read_hysitron(file, place))]
    if file.suffix.lower() == ".hld":
        nanodent = reader_of(place, file, "a .hld file", "nanodent", ", or export the curve as .txt")
        data = nanodent.load_experiment(file).trace
        return [(file.stem, (data["time_s"], data["disp_nm"], data["force_uN"] / 1e3))]
    indentation = reader_of(
        place, file, f"a {file.suffix} file", "micromechanics.indentation", ", or write its columns to a CSV"
    ).Indentation
    data, tests = indentation(str(file)), []
    while True:
        # The package has um and mN.
        tests.append((str(data.testName or file.stem), (data.raw.t, 1e3 * data.raw.h, data.raw.p)))
        if not data.testList:
            return tests
        data.nextTest()


def read_hysitron(file: Path, place: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A curve that a Hysitron TI 990 exported: text whose lines end in CR, and in Latin-1."""
    try:
        lines = file.read_bytes().decode("latin-1").splitlines()
    except OSError as error:
        raise InputError(f"{place}{error.strerror}") from None
    start = next((i for i, line in enumerate(lines) if line.lower().startswith("depth (")), None)
    if start is None:
        raise InputError(f"{place}no line begins with 'Depth ('; a curve that a Hysitron exported as text is needed")
    names = [name.strip().lower() for name in lines[start].split("\t")]
    try:
        order = [
            next((j, UNITS[name]) for j, name in enumerate(names) if name in UNITS and name.startswith(word))
            for word in ("time", "depth", "load")
        ]
    except StopIteration:
        raise InputError(f"{place}line {start + 1}: the columns Depth, Load and Time are needed, in {', '.join(UNITS)}") from None
    rows = []
    for number, line in enumerate(filter(str.strip, lines[start + 1 :]), start + 2):
        try:
            cells = line.split("\t")
            rows.append([float(cells[j]) * scale for j, scale in order])
        except (ValueError, IndexError):
            raise InputError(f"{place}line {number}: {line[:40]!r} is no row of numbers") from None
    stated = next((int(line.split("=")[1]) for line in lines[:start] if line.startswith("Number of Points =")), len(rows))
    if stated != len(rows):
        raise InputError(f"{place}{len(rows)} points, where the file states {stated}; it is truncated")
    time, depth, load = np.transpose(rows)
    return time, depth, load


def tdm_settings(file: str | os.PathLike) -> dict[str, float | bool]:
    """What a .tdm file says that the instrument removed from its curve: drift_nm_s, compliance_nm_mn, and whether it removed the drift."""
    text = Path(file).read_text(encoding="utf-8", errors="replace")
    names = {"drift_nm_s": "Drift_Rate__nm___s__", "compliance_nm_mn": "Machine_Compliance__nm___mN__", "drift_removed": "Drift_Correction"}
    found = {key: re.search(rf'name="Current_{name}">([^<]*)<', text) for key, name in names.items()}
    values = {key: float(match[1]) for key, match in found.items() if match and abs(float(match[1])) < NO_VALUE}
    return {key: bool(value) if key == "drift_removed" else value for key, value in values.items()}
