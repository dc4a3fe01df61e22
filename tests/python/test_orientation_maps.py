"""Orientations from a map (EBSD) at the positions of the indents. The maps are made here, in the
formats of two vendors and of orix.
"""

import sys

import numpy as np
import pytest

import bayesindent as bi
from support.diagnostics import of_code
from support.orientation_maps import (
    EDGE,
    LEFT,
    RIGHT,
    SD_DEG,
    along,
    columns,
    measured,
    pixels,
    write,
)

orix_io = pytest.importorskip("orix.io")


@pytest.mark.parametrize("ending", ["ang", "ctf", "h5"])
def test_the_mean_orientation_of_the_grain_at_each_indent(tmp_path, capsys, ending):
    path = write(tmp_path / f"map.{ending}", *pixels())
    capsys.readouterr()
    points = measured(path, [(2.1, 5.2), (12.3, 4.9)]).measurements
    # Standard output is the document's.
    assert capsys.readouterr().out == ""
    for found, true in zip(along(points.euler_deg), along([LEFT, RIGHT]), strict=True):
        # Some 300 points of this sd: the mean is known to a hundredth of a degree or so.
        assert np.degrees(np.arccos(min(1, found @ true))) < 0.15
    assert len(points) == 2


def test_equivalent_orientations_within_a_grain_are_one(tmp_path):
    plain, mixed = (
        measured(write(tmp_path / f"{k}.h5", *pixels(k)), [(2.1, 5.2), (12.3, 4.9)]).measurements
        for k in (False, True)
    )
    assert along(mixed.euler_deg) == pytest.approx(along(plain.euler_deg), abs=1e-9)


def test_diffraction_adds_the_inversion_to_the_symmetry(tmp_path):
    """Of zincblende -43m a quarter turn about [001], which the crystal has not, is told from none
    by no map.
    """
    mixed = measured(
        write(tmp_path / "map.h5", *pixels(True), "-43m"), [(2.1, 5.2), (2.6, 5.2), (12.3, 4.9)]
    )
    assert len(mixed.measurements) == 2 and mixed.warnings == []


@pytest.mark.parametrize(
    ("point_group", "symmetry", "told"),
    [
        ("m-3", "cubic", ""),
        ("622", "hexagonal", ""),
        ("-3m", "trigonal", ""),
        ("mmm", "orthorhombic", ""),
        ("121", "monoclinic", ""),
        (
            "-3m",
            "hexagonal",
            "trigonal (-3m), symmetry is hexagonal, which takes the crystal for more "
            "symmetric than the map does",
        ),
        (
            "4/mmm",
            "cubic",
            "tetragonal (4/mmm), symmetry is cubic, which takes the crystal for more "
            "symmetric than the map does",
        ),
    ],
)
def test_the_phase_has_the_stated_symmetry(tmp_path, point_group, symmetry, told):
    problem = measured(
        write(tmp_path / "map.h5", *pixels(), point_group), [(2.1, 5.2), (12.3, 4.9)], symmetry
    )
    said = [each["subject"] for each in of_code(problem.warnings, "phase_differs")]
    assert said == ([f"the phase iron is {told}"] if told else [])


@pytest.mark.parametrize(
    ("point_group", "symmetry"),
    [("m-3m", "tetragonal"), ("-3m", "cubic"), ("6/mmm", "trigonal"), ("4/mmm", "4/m")],
)
def test_a_phase_whose_equivalents_are_none_is_refused(tmp_path, point_group, symmetry):
    path = write(tmp_path / "map.h5", *pixels(), point_group)
    with pytest.raises(
        bi.InputError,
        match=(
            f"map.h5: the phase iron is .+, symmetry is {symmetry}: orientations that are equiv"
        ),
    ):
        measured(path, [(2.1, 5.2), (12.3, 4.9)], symmetry)


def test_one_phase_is_measured(tmp_path):
    x, y, euler = pixels()
    path = write(tmp_path / "map.h5", x, y, euler, phases=np.where(x < EDGE, 1, 2))
    assert len(measured(path, [(2.1, 5.2), (6.0, 5.0)]).measurements) == 1
    with pytest.raises(
        bi.InputError,
        match="row 1 is on the phase iron, those of rows 3 are on second; leave one of them out",
    ):
        measured(path, [(2.1, 5.2), (6.0, 5.0), (12.3, 4.9)])


def test_spread_distance_and_grain(tmp_path):
    problem = measured(write(tmp_path / "map.h5", *pixels()), [(6.0, 5.0), (2.0, 5.0), (10.0, 5.0)])
    grain, spread, radius = columns(problem, "grain", "orientation_sd_deg", "grain_radius_um")
    # The tilt of the direction is in two of the three components of the turn.
    assert [float(value) for value in spread] == pytest.approx(3 * [SD_DEG], rel=0.1)
    # The edge is half way between the last point of one grain, at 7.5 um, and the first of the
    # other at 8 um.
    assert [float(value) for value in radius] == pytest.approx([1.75, 5.75, 2.25], abs=1e-9)
    assert grain[0] == grain[1] != grain[2]
    # Two indents in one grain are tests of it.
    assert len(problem.measurements) == 2
    assert problem.measurements.names == [grain[0], grain[2]]


def test_columns_of_the_user_go_before(tmp_path):
    path = write(tmp_path / "map.h5", *pixels())
    problem = measured(
        path, [(6.0, 5.0), (2.0, 5.0)], grain=["a", "b"], grain_radius_um=[50.0, 60.0]
    )
    assert problem.measurements.names == ["a", "b"]
    assert "grain_radius_um" in problem.table.meanings
    assert measured(path, [(6.0, 5.0)], **{"Grain ID": ["c"]}).measurements.names == ["c"]
    with pytest.raises(
        bi.InputError,
        match="map.h5: the column phi1_deg states the orientation too; one of them is allowed",
    ):
        measured(path, [(6.0, 5.0)], Euler1=[10.0])
    with pytest.raises(bi.InputError, match="the column u states the orientation too"):
        measured(path, [(6.0, 5.0)], u=[1], v=[1], w=[2])


def test_columns_of_the_user_may_have_any_header(tmp_path):
    path = write(tmp_path / "map.h5", *pixels())
    table = {
        "right": [6.0, 2.0],
        "down": [5.0, 5.0],
        "Er": [200.0, 201.0],
        "sd": [4.0, 4.0],
        "Korn": ["a", "b"],
    }
    named = {"x_um": "right", "y_um": "down", "grain": "Korn"}
    problem = bi.Problem.from_keywords(
        "f",
        {"measurements": table},
        problem={"symmetry": "cubic"},
        measurements={"ebsd": path, "columns": named},
    )
    assert problem.measurements.names == ["a", "b"]
    assert [float(value) for value in columns(problem, "grain_radius_um")[0]] == pytest.approx(
        [1.75, 5.75], abs=1e-9
    )


def test_noise_is_no_boundary(tmp_path):
    x, y, euler = pixels()
    euler[np.flatnonzero((x == 3.0) & (y == 5.0))] = RIGHT
    problem = measured(write(tmp_path / "map.h5", x, y, euler), [(2.4, 5.0)])
    (radius,) = columns(problem, "grain_radius_um")
    assert float(radius[0]) == pytest.approx(5.35, abs=1e-9)


@pytest.mark.parametrize(
    ("positions", "further", "words"),
    [
        (
            [(2.0, 2.0), (80.0, 2.0)],
            {},
            r"row 2: \(80, 2\) um is 65.5 um from the next indexed point; the map is from \(0, "
            r"0\) to \(14.5, 9.5\)",
        ),
        ([(2.0, np.nan)], {}, "line 1: x_um or y_um is empty; numbers are needed"),
    ],
)
def test_refusals(tmp_path, positions, further, words):
    with pytest.raises(bi.InputError, match=words):
        measured(write(tmp_path / "map.h5", *pixels()), positions, **further)


def test_what_is_no_map(tmp_path, monkeypatch):
    path = tmp_path / "map.ang"
    with pytest.raises(bi.InputError, match="map.ang: the file does not exist"):
        measured(path, [(1.0, 1.0)])
    path.write_text("nothing\n")
    with pytest.raises(
        bi.InputError,
        match=r"map.ang: is no map .ang that can be read; export it again \(ValueError\)",
    ):
        measured(path, [(1.0, 1.0)])
    monkeypatch.setitem(sys.modules, "orix", None)
    with pytest.raises(
        bi.InputError,
        match=r"needs orix, which is not installed: \./bayesindent setup --with ebsd$",
    ):
        measured(path, [(1.0, 1.0)])


def test_a_message_quotes_no_line_of_a_file_that_is_no_map(tmp_path):
    (tmp_path / "map.ang").write_text("# a header\nroot:x:0:0:root:/root:/bin/bash\n" * 3)
    with pytest.raises(
        bi.InputError,
        match=r"map.ang: is no map .ang that can be read; export it again \(ValueError\)",
    ) as error:
        measured(tmp_path / "map.ang", [(1.0, 1.0), (2.0, 2.0)])
    assert "root" not in str(error.value).partition("map.ang")[2]
