"""Files that were damaged are refused in one line that names them; rows of a campaign know when
they were changed.
"""

import json
import random
import re
import shutil
import sqlite3
import struct
from contextlib import closing

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.common.result_files import read_json, whole_file, write_json
from bayesindent.core import HEADER, BayesindentError, InputError
from bayesindent.crystal.elasticity import stiffness_rows
from bayesindent.program.cli import main
from bayesindent.settings.problem import Problem
from bayesindent.stages.results_folder import read_posterior, read_resolved
from bayesindent.stages.stage import Stage, run_stage
from bayesindent.surrogate.surrogate import Surrogate
from support.campaigns import past_trigger, rows
from support.csv_tables import numbers, read_rows
from support.learner import fnv_1a
from support.tree import REFERENCE, SOURCE

#: Identity of the physics.
THEORY = '{"simulator": "theory"}'


def bits_changed(content: bytes, count: int, seed: int = 1):
    """The content with one bit or another changed."""
    dice = random.Random(seed)
    for _ in range(count):
        at = dice.randrange(len(content))
        yield content[:at] + bytes([content[at] ^ (1 << dice.randrange(8))]) + content[at + 1 :]


def simulated(folder, count: int = 20, simulator: str = "theory") -> list:
    """What `simulate` says of crystals in a folder. Those that its campaign has not are simulated
    by a formula.
    """
    lines = [f"{200 + i / 7!r},100,50,{0.1 * i!r},0,0\n" for i in range(count)]
    (folder / "points.csv").write_text("C11,C12,C44,phi1_deg,Phi_deg,phi2_deg\n" + "".join(lines))
    text = (
        "&problem symmetry = 'cubic' /\n"
        "&crystals points = 'points.csv' /\n"
        "&execution workers = 1 /\n"
    )
    (folder / "a.nml").write_text(f"{text}&simulation simulator = '{simulator}', refine = 0.6 /\n")

    def simulate(job):
        modulus = 150.0 + (job.stiffness[0, 0] - 200) * 7 / 3
        return {
            "modulus_gpa": modulus,
            "seconds": 0.1,
            "elements": 8,
            "depth_um": [0.1, 0.2],
            "force_mn": [1.0, modulus],
        }

    return run_stage(Problem(folder / "a.nml", "simulate"), "simulate", folder, simulate=simulate)[
        "results"
    ]


def change_row(file: sqlite3.Connection, change: str) -> None:
    """Change the row of position 7 of a campaign."""
    statement = f"UPDATE simulation SET {change} WHERE position = 7"
    past_trigger(file, "simulation_is_not_changed", statement)


@pytest.mark.parametrize(
    "change",
    [
        "indentation_modulus_gpa = indentation_modulus_gpa * (1 + 1e-15)",
        "constants = '[202.0, 100.0, 50.0]'",
        "euler_deg = '[1.0, 0.0, 0.0]'",
        "status = 'failed'",
        "origin = 'told'",
        "elements = 9",
        "symmetry = 'isotropic'",
        "force_mn = '[1.0]'",
    ],
)
def test_a_row_that_was_changed_is_refused(tmp_path, change):
    path = tmp_path / "campaign.sqlite"
    simulated(tmp_path)
    with closing(sqlite3.connect(path)) as file:
        change_row(file, change)
        assert file.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    with pytest.raises(InputError, match="campaign.sqlite: is .* damaged .the row of position 7"):
        learnt(tmp_path)


@pytest.mark.timeout(60)
@pytest.mark.parametrize(
    "attack",
    [
        # A view that never ends, in place of the table.
        "ALTER TABLE simulation RENAME TO other; CREATE VIEW simulation AS "
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i AS id FROM n",
        "CREATE VIEW more AS SELECT 1",
        "CREATE TRIGGER added AFTER INSERT ON simulation BEGIN SELECT 1; END",
        "DROP TRIGGER simulation_is_not_deleted",
        "CREATE TABLE other (x)",
    ],
)
def test_another_schema_is_refused(tmp_path, attack):
    simulated(tmp_path)
    with closing(sqlite3.connect(tmp_path / "campaign.sqlite")) as file:
        file.executescript(attack)
    with pytest.raises(InputError, match="campaign.sqlite: is not a campaign, or is damaged"):
        simulated(tmp_path)


def learnt(folder) -> int:
    """How many simulations of the campaign a build learns from."""
    text = (
        (folder / "a.nml").read_text()
        + "&domain log_anisotropy_max = 3 /\n&design budget = 20 /\n&surrogate degree = 1 /\n"
    )
    (folder / "b.nml").write_text(text)
    return 20 - Stage(Problem(folder / "b.nml", "build"), "build", folder).expected


def test_rows_moved_to_another_physics_are_refused(tmp_path):
    path = tmp_path / "campaign.sqlite"
    simulated(tmp_path)
    assert learnt(tmp_path) == 20
    other = tmp_path / "other"
    other.mkdir()
    simulated(other, 1, "fe")
    with closing(sqlite3.connect(other / "campaign.sqlite")) as file:
        identity = file.execute("SELECT identity FROM physics").fetchone()
    with closing(sqlite3.connect(path)) as file:
        file.execute("UPDATE physics SET identity = ?", identity)
        file.commit()
    (tmp_path / "a.nml").write_text((tmp_path / "a.nml").read_text().replace("'theory'", "'fe'"))
    with pytest.raises(InputError, match="was changed"):
        learnt(tmp_path)


def test_bits_of_a_campaign(tmp_path):
    """Whatever bit is changed: the file is refused by its name, or the rows are the same."""
    path = tmp_path / "campaign.sqlite"
    results, content = simulated(tmp_path), path.read_bytes()
    stored, refused = rows(path), 0
    for bad in bits_changed(content, 80):
        path.write_bytes(bad)
        try:
            assert simulated(tmp_path) == results
            # Another identity of the physics, or another crystal: the row is one that nobody asks
            # for, and the asked one is made anew.
            assert learnt(tmp_path) == 20
            assert [row[1:] for row in rows(path, THEORY)] == [row[1:] for row in stored]
        except InputError as error:
            assert str(error).startswith(f"{path}: ")
            assert "\n" not in str(error)
            refused += 1
    assert refused > 8


@pytest.mark.parametrize("content", [b"", b"\x89PNG\r\n\x1a\n" + bytes(100), b'{"a": 1}\n'])
def test_other_files_are_no_campaign(tmp_path, content):
    path = tmp_path / "campaign.sqlite"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"campaign.sqlite: is not a campaign, or is damaged"):
        simulated(tmp_path)
    assert path.read_bytes() == content


def test_rows_without_a_checksum_are_refused(tmp_path):
    simulated(tmp_path)
    with closing(sqlite3.connect(tmp_path / "campaign.sqlite")) as file:
        change_row(file, "checksum = NULL")
    with pytest.raises(InputError, match="the row of position 7 was changed"):
        simulated(tmp_path)


def test_bits_of_a_surrogate(tmp_path):
    path = tmp_path / "surrogate.txt"
    rows = np.hstack(
        [np.random.default_rng(1).uniform((150, 50, 40), (200, 90, 80), (12, 3)), np.zeros((12, 3))]
    )
    moduli = bi.halfspace_modulus(stiffness_rows("cubic", rows[:, :3]), rows[:, 3:])
    domain = {"c_min": (50, 40, 15), "c_max": (250, 150, 120)}
    settings = {"model": "paper", "degree": 1, "bandlimit": 0}
    Surrogate.fit(
        rows[:, :3], rows[:, 3:], moduli, symmetry="cubic", domain=domain, **settings
    ).save(path)
    content = path.read_bytes()
    Surrogate.load(path)
    for bad in [
        b"",
        content[:-1],
        content[:100],
        content + b"\n",
        bytes(1000),
        *bits_changed(content, 80),
    ]:
        path.write_bytes(bad)
        with pytest.raises(InputError) as error:
            Surrogate.load(path)
        assert str(error.value).startswith(f"{path}: ")
        assert len(str(error.value).splitlines()) == 1


@pytest.fixture(scope="module")
def sampled(tmp_path_factory):
    """A folder with a posterior."""
    folder = tmp_path_factory.mktemp("sampled")
    text = (
        "&problem symmetry = 'cubic' /\n"
        "&surrogate file = 'halfspace' /\n"
        f"&measurements file = '{REFERENCE / 'cubic_fe3si.csv'}', "
    )
    (folder / "a.nml").write_text(
        text
        + (
            "modulus_kind = 'indentation_modulus' /\n"
            "&sampler samples = 600, burn_in = 1000, chains = 2, draws = 'csv' /\n"
        )
    )
    assert main(["extract", str(folder / "a.nml"), "--output", str(folder / "out")]) == 0
    return folder / "out"


@pytest.mark.parametrize(
    ("place", "value"),
    [
        # Of an earlier version.
        (("warnings",), ["the sds are small"]),
        (("prior", "density"), None),
        (("format",), 1),
        # Of a stranger: kinds, numbers, shapes, names.
        (("usable",), 1),
        (("parameters", "C11", "sd"), "x"),
        (("parameters", "C11", "mean"), 1e308),
        (("parameters", "C11", "mean"), None),
        (("parameters", "C11", "hdi_95"), [1.0, 2.0, 3.0]),
        (("parameters", "C44"), None),
        (("error_budget", "C12", "more"), 0.5),
        (("identifiability", 0, "kind"), "quantity"),
        (("predicted", 1), {}),
        (("chains",), -2),
    ],
)
@pytest.mark.parametrize("command", ["report", "compare"])
def test_documents_of_an_earlier_version_and_of_a_stranger(
    sampled, tmp_path, capsys, command, place, value
):
    """They are named, with the command that makes them anew, unless they can be used."""
    folder = shutil.copytree(sampled, tmp_path / "out")
    path = folder / "summary.json"
    document = read_json(path)
    inside = document
    for key in place[:-1]:
        inside = inside[key]
    inside[place[-1]] = value
    write_json(path, document)
    capsys.readouterr()
    others = [str(sampled)] if command == "compare" else []
    status = main([command, str(folder), *others])
    found = capsys.readouterr().err.splitlines()
    if place == ("format",):
        assert status == 2 and len(found) == 1
        assert found[0].startswith(f"{path}: is of an earlier version")
        assert "bayesindent extract" in found[0]
    elif status:
        # Values that change no more than a number are read.
        assert status == 2 and len(found) == 1
        assert str(path) in found[0]
        assert "bayesindent run" in found[0]


def value_at(content: bytes, name: str) -> int:
    """The position of the header of a named value."""
    at = 0
    while True:
        _, _, length, size, *_ = HEADER.unpack_from(content, at)
        start = at + HEADER.size
        if content[start : start + length].decode() == name:
            return at
        at = start + length + -length % 8 + size + -size % 8


@pytest.mark.timeout(60)
@pytest.mark.parametrize(
    ("name", "offset", "change"),
    [
        # Sizes of a value that are negative, too large, and not those of its shape.
        ("inputs", 8, struct.pack("<q", -8)),
        ("inputs", 8, struct.pack("<q", 2**62)),
        ("draws", 8, struct.pack("<q", 8)),
        # Lengths of a name, kinds, ranks, shapes.
        ("inputs", 4, struct.pack("<i", -(2**31))),
        ("inputs", 4, struct.pack("<i", 0)),
        ("draws", 0, b"x"),
        ("draws", 0, b"t"),
        ("draws", 1, b"\xff"),
        ("draws", 16, struct.pack("<3q", -3, -600, 2)),
        ("draws", 16, struct.pack("<3q", 2**40, 2**40, 2**40)),
        ("draws", HEADER.size, b"drawn"),
        ("draws", HEADER.size + 8, struct.pack("<d", float("nan"))),
    ],
)
def test_a_posterior_of_a_stranger(sampled, tmp_path, capsys, name, offset, change):
    """The checksum is right: lengths, names, kinds, shapes and draws are checked as well."""
    folder = shutil.copytree(sampled, tmp_path / "out")
    path = folder / "posterior.bin"
    content = bytearray(path.read_bytes()[:-16])
    at = value_at(content, name) + offset
    content[at : at + len(change)] = change
    path.write_bytes(content + f"{fnv_1a(content):016X}".encode())
    capsys.readouterr()
    assert main(["next", str(sampled.parent / "a.nml"), "--output", str(folder)]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith(f"{path}: "), last


def test_bits_of_a_posterior(sampled, tmp_path, capsys):
    folder = shutil.copytree(sampled, tmp_path / "out")
    path = folder / "posterior.bin"
    content, values = path.read_bytes(), read_posterior(folder)
    drawn = numbers(read_rows(folder / "posterior.csv"), ["C11", "C12", "C44", "contrast"])
    assert values["draws"].reshape(-1, 4).tolist() == drawn.tolist()
    for bad in [
        b"",
        content[:-1],
        content[:100],
        content + b"\n",
        bytes(1000),
        *bits_changed(content, 80),
    ]:
        path.write_bytes(bad)
        with pytest.raises(InputError, match="posterior.bin: is damaged"):
            read_posterior(folder)
    for command in (["report", str(folder)], ["compare", str(sampled), str(folder)]):
        capsys.readouterr()
        assert main(command) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"{path}: is damaged")
    path.write_bytes(content)
    again = read_posterior(folder)
    assert (
        again.keys() == values.keys()
        and (again["draws"] == values["draws"]).all()
        and again["inputs"] == values["inputs"]
    )


def test_the_copy_for_arviz_is_read_by_its_name(sampled):
    import h5netcdf

    with h5netcdf.File(sampled / "posterior.nc", "r") as file:
        assert (
            file["posterior"]["C11"][...].tolist()
            == read_posterior(sampled)["draws"][..., 0].tolist()
        )


@pytest.mark.parametrize("content", [b"", b"{", b"[1]", b"\xff\xfe", b'{"a": 1}}', b"[" * 100000])
def test_documents_that_are_none(tmp_path, capsys, content):
    path = tmp_path / "summary.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match="summary.json: is damaged, or is no JSON document"):
        read_json(path)
    assert main(["report", str(tmp_path)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(captured.err.splitlines()) == 1
    assert str(path) in captured.err


def test_bits_of_a_document(tmp_path):
    """Whatever bit is changed: the document is refused by the name of its file, or it is the
    same.
    """
    path, document = (
        tmp_path / "summary.json",
        {
            "C11": {"mean": 168.4, "sd": 0.1 + 0.2},
            "rows": [[1, None], [-0.0, 1e-300]],
            "words": "µ",
        },
    )
    write_json(path, document)
    assert read_json(path) == document
    content, outcomes = path.read_bytes(), []
    for bad in bits_changed(content, 400):
        path.write_bytes(bad)
        try:
            # The name of the checksum alone may be another one: all else is whole then.
            outcomes.append(document.items() <= read_json(path).items())
        except InputError as error:
            assert re.fullmatch(
                r"\S*summary.json: is damaged, or is no JSON document \(.*\); remove it, .*",
                str(error),
            )
            outcomes.append(None)
    assert False not in outcomes and outcomes.count(None) > 300
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match="summary.json: is damaged"):
        read_json(path)


def test_results_of_another_namelist_are_not_mixed(sampled, tmp_path, capsys, few_figures):
    """Somebody put another namelist beside the results."""
    folder = shutil.copytree(sampled, tmp_path / "out")
    assert read_resolved(folder) == Problem(sampled.parent / "a.nml", "extract").resolved
    assert main(["report", str(folder)]) == 0
    text = (folder / "resolved.nml").read_text()
    (folder / "resolved.nml").write_text(text.replace("cubic", "hexagonal"))
    capsys.readouterr()
    assert main(["report", str(folder)]) == 2
    assert "resolved.nml: is not what the results beside it came from" in capsys.readouterr().err


def test_a_full_disk_is_told_in_words(tmp_path, monkeypatch):
    """/dev/full stands for a file that is written; for the files of the core see
    tests/cli/test_faults.py.
    """
    from bayesindent.common import result_files

    kept = tmp_path / "kept.json"
    write_json(kept, {"a": 1})

    def full(path, name):
        return type(path)("/dev/full") if name.startswith(".") else path.parent / name

    monkeypatch.setattr(result_files.Path, "with_name", full)
    monkeypatch.setattr(result_files.Path, "unlink", lambda *_, **__: None)
    monkeypatch.setattr(result_files.os, "O_EXCL", 0)
    with pytest.raises(OSError, match="No space left") as error, whole_file(kept) as beside:
        beside.write_text("x" * 100000)
    assert error.value.filename == str(kept)
    assert read_json(kept) == {"a": 1}


def test_a_core_that_cannot_write_says_so(tmp_path):
    """A folder of the system takes no files from anybody."""
    simulated(tmp_path)
    with pytest.raises(
        BayesindentError, match="/sys/kernel/campaign.sqlite: the campaign cannot be used"
    ):
        Stage(Problem(tmp_path / "a.nml", "simulate"), "simulate", "/sys/kernel")


def test_every_writer_goes_through_one_helper():
    """In Python `result_files`, in Fortran `files`; a surrogate is unpickled by way of a folder of
    its own that is gone at once.
    """
    python = re.compile(
        r"\.write_(text|bytes)\(|open\([^)]*[\"'][wax]b?[\"']"
        r"|\.to_netcdf\(|\.dump\(|\.save\(\s*[\"']"
    )
    fortran = re.compile(
        r"action\s*=\s*'(read)?write'|status\s*=\s*'(replace|new|unknown)'", re.IGNORECASE
    )
    found = []
    for folder, pattern, kind, helper in (
        ("python", python, "*.py", "result_files.py"),
        ("fortran", fortran, "*.f90", "files.f90"),
    ):
        for path in (SOURCE / folder).rglob(kind):
            if path.name != helper:
                found += [
                    f"{path.name}: {line.strip()}"
                    for line in path.read_text().splitlines()
                    if pattern.search(line)
                ]
    # A surrogate in a temporary folder.
    assert [line.partition(":")[0] for line in found] == ["surrogate.py"]


@pytest.mark.parametrize("line", ["-1", "1e+30", "[", "[]"])
def test_a_provenance_of_a_stranger(tmp_path, line):
    Surrogate.load("block").save(tmp_path / "surrogate.txt")
    text = (tmp_path / "surrogate.txt").read_text()
    at = text.index("\nprovenance ") + 1
    body = f"{text[:at]}provenance 1\n{line}\n"
    path = tmp_path / "other.txt"
    path.write_text(f"{body}checksum {fnv_1a(body.encode()):016X}\n")
    with pytest.raises(InputError, match="other.txt: the surrogate is damaged: its provenance"):
        Surrogate.load(path)
