"""`bench mutations` in short: inputs with a few bytes changed are read, or refused in one line that
names the file.
"""

import random

import pytest

import bayesindent as bi
from benchmarks.bench_mutations import (
    MAPS,
    SEEDS,
    STORED,
    exported,
    mutated,
    prepare,
    read,
    text,
    try_in_process,
    try_results,
    write,
)

WHOLE = '"' + 200_000 * "a"


def test_changed_inputs_are_read_or_refused(tmp_path):
    counted, failures = try_in_process(250, 7, tmp_path)
    assert failures == []
    assert {kind for (kind, _), count in counted.items() if count > 0} >= {*SEEDS}
    # Neither is all refused nor all read: the changes are small, and they matter.
    assert counted["table", "read"] > 0 and counted["namelist", "refused"] > 0


@pytest.mark.long
def test_changed_results_with_right_checksums_are_read_or_refused(tmp_path):
    counted, failures = try_results(120, 7, tmp_path)
    assert failures == []
    assert {file for (file, _), count in counted.items() if count > 0} >= {*STORED}


def test_changes_change():
    rng, content = random.Random(1), SEEDS["namelist"][1][0]
    assert sum(mutated(content, rng) != content for _ in range(50)) > 30


@pytest.mark.parametrize(
    ("kind", "content"),
    [
        ("shared errors", text("grain,shared_1", "a,0.02", "b,0.02,-3", "c,0.1")),
        (
            "crystals",
            text(
                "symmetry,C11,C12,C44,phi1_deg,Phi_deg,phi2_deg",
                "cubic,269.230769,115.384615,1e-320,0,0,0",
            ),
        ),
        (
            "laboratory table",
            text(
                "phi1;Phi;phi2;Er;StDev;N",
                "46,3;88,7;19,3;180;3 and 4;4",
                "47,3;80,7;39,3;181;3,5;4",
            ),
        ),
        (
            "laboratory table",
            text("phi1,Phi,phi2,Er,grain", "1,2,3,180 GPa,a", '4,5,6,"181,5",a', "7,8,9,1d999,b"),
        ),
        ("laboratory table", text("phi1,Phi,phi2,Er,sd", WHOLE)),
        ("points", text("x_um,y_um,map_x_um,map_y_um", WHOLE)),
        ("map", MAPS[".ctf"].replace(b"1\t5\t1\t", b"1\t1e308\t1\t")),
    ],
)
def test_what_cannot_be_is_one_line_that_names_the_file(tmp_path, kind, content):
    prepare(tmp_path)
    assert read(write(kind, content, tmp_path), kind, "run") == "refused"


def test_a_pattern_that_is_none_is_one_line(tmp_path):
    prepare(tmp_path)
    path = write("instrument", exported(100), tmp_path)
    namelist = path.with_suffix(".nml")
    namelist.write_text(namelist.read_text().replace(path.name, "c**d"))
    with pytest.raises(
        bi.InputError,
        match=r"&curves files: c\*\*d: (is no pattern of file names|there is no such file)",
    ):
        bi.Problem(namelist, "curves")


def test_a_number_of_points_that_is_none_is_not_compared(tmp_path):
    prepare(tmp_path)
    assert read(
        write("instrument", exported(100).replace(b"60", b"nan", 1), tmp_path), "instrument", "run"
    ).startswith("read")
