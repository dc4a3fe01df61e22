"""Positions of the stage led to those of an orientation map by homologous points, and the map's
picture.
"""

import json

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.program.cli import main
from bayesindent.report.figures.maps import draw_map, orientation_map
from bayesindent.report.results import Results
from support.diagnostics import codes, of_code
from support.orientation_maps import EDGE, LEFT, along, measured, pixels, write

pytest.importorskip("orix.io")

#: Stage to map: turned by 90 degrees, mirrored, sheared a little, elsewhere.
TURN, OFFSET = np.array([[0.02, -1.03], [-0.98, 0.05]]), np.array([13.0, 250.0])
#: Corners of the sample on the map, um, then one within.
CORNERS = np.array([[0.5, 0.5], [14.0, 1.0], [13.5, 9.0], [1.0, 9.5], [7.0, 4.0]])


def stage_of(places):
    """Where the stage has places of the map."""
    return (np.asarray(places) - OFFSET) @ np.linalg.inv(TURN).T


def points_file(path, places=CORNERS, errors=0.0):
    stage = stage_of(places)
    rows = np.column_stack([stage, np.asarray(places) + errors])
    np.savetxt(
        path,
        rows,
        delimiter=",",
        header="# marks of the sample\nx_um,y_um,map_x_um,map_y_um",
        comments="",
    )
    return path


def registered(tmp_path, places, points, settings=None, **further):
    path = write(tmp_path / "map.h5", *pixels())
    stage = dict(zip(("x_um", "y_um"), stage_of(places).T.tolist(), strict=True))
    table = (
        stage | {"Er": [200.0 + k for k in range(len(places))], "sd": len(places) * [4.0]} | further
    )
    return bi.Problem.from_keywords(
        "f",
        {"measurements": table},
        problem={"symmetry": "cubic"},
        measurements={"ebsd": path, "ebsd_points": points} | (settings or {}),
    )


def test_homologous_points_lead_to_the_grains(tmp_path):
    places = [(2.1, 5.2), (12.3, 4.9)]
    problem = registered(tmp_path, places, points_file(tmp_path / "points.csv"))
    assert problem.map.positions == pytest.approx(np.array(places), abs=1e-9)
    plain = measured(tmp_path / "map.h5", places).measurements
    assert along(problem.measurements.euler_deg) == pytest.approx(along(plain.euler_deg), abs=1e-9)
    assert not of_code(problem.warnings, "indents_left_out", "registration_unknown")


def test_an_indent_near_a_boundary_is_named_and_left_out(tmp_path):
    errors = 0.4 * np.array([[1, -1], [-1, 0.5], [0.5, 1], [-0.5, -0.5], [0, 0]])
    path = points_file(tmp_path / "points.csv", errors=errors)
    # The distance to the boundary in sds of the registration, of the second indent.
    problem = registered(tmp_path, [(2.0, 5.0), (EDGE - 0.6, 5.0)], path, grain=["a", "b"])
    (found,) = of_code(problem.warnings, "indents_left_out")
    design = np.column_stack([np.ones(5), stage_of(CORNERS)])
    residual = CORNERS + errors - design @ np.linalg.lstsq(design, CORNERS + errors, rcond=None)[0]
    at = np.array([1, *stage_of([(EDGE - 0.6, 5.0)])[0]])
    sd = np.sqrt((residual**2).sum() / 4 * (1 + at @ np.linalg.inv(design.T @ design) @ at))
    share = int(found["subject"].partition("rows 2 (")[2].partition("%")[0]) / 100
    shift = EDGE - 0.25 - (at @ np.linalg.lstsq(design, CORNERS + errors, rcond=None)[0])[0]
    from scipy.stats import norm

    assert share == pytest.approx(norm.cdf(shift / sd), abs=0.06)
    assert "rows 1" not in found["subject"]
    assert (problem.map.rows, len(problem.map.positions), len(problem.measurements)) == ([0], 1, 1)
    assert problem.measurements.names == ["a"]
    assert along(problem.measurements.euler_deg)[0] == pytest.approx(along([LEFT])[0], abs=0.003)
    with pytest.raises(bi.InputError, match=r"rows 1 \(.*are left out"):
        registered(tmp_path, [(EDGE - 0.6, 5.0)], path)


def test_rows_of_the_table_are_named_whatever_was_left_out_before(tmp_path):
    places = [(2.0, 5.0), (3.0, 5.0), (EDGE - 0.2, 5.0)]
    errors = 0.4 * np.array([[1, -1], [-1, 0.5], [0.5, 1], [-0.5, -0.5], [0, 0]])
    path = points_file(tmp_path / "points.csv", errors=errors)
    problem = registered(tmp_path, places, path, Er=[None, 200.0, 210.0])
    (found,) = of_code(problem.warnings, "indents_left_out")
    assert "rows 3 (" in found["subject"]
    with pytest.raises(bi.InputError, match=r"row 3: \(900, 5\) um is"):
        measured(tmp_path / "map.h5", [*places[:2], (900.0, 5.0)], Er=[None, 200.0, 210.0])


def test_shared_errors_have_a_row_for_indents_that_are_left_out_too(tmp_path):
    errors = 0.4 * np.array([[1, -1], [-1, 0.5], [0.5, 1], [-0.5, -0.5], [0, 0]])
    path, shared = points_file(tmp_path / "points.csv", errors=errors), tmp_path / "shared.csv"
    places, settings = [(EDGE - 0.6, 5.0), (2.0, 5.0), (2.5, 4.0)], {"shared_errors": str(shared)}
    shared.write_text("radius\n0.5\n0.01\n0.02\n")
    assert registered(tmp_path, places, path, settings).map.rows == [1, 2]
    shared.write_text("radius\n0.01\n0.02\n")
    with pytest.raises(bi.InputError, match="2 rows for 3 of the measurements"):
        registered(tmp_path, places, path, settings)


def test_three_points_leave_the_error_unknown(tmp_path):
    problem = registered(tmp_path, [(2.0, 5.0)], points_file(tmp_path / "three.csv", CORNERS[:3]))
    assert "registration_unknown" in codes(problem.warnings)
    assert problem.map.positions[0] == pytest.approx([2.0, 5.0], abs=1e-9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "x_um,y_um,map_x_um,map_y_um\n0,0,1,1\n5,5,6,6\n",
            "2 points on a line or at one place; three or more",
        ),
        (
            "x_um,y_um,map_x_um,map_y_um\n0,0,1,1\n5,5,6,6\n9,9,10,10\n",
            "3 points on a line or at one place",
        ),
        (
            "x_um,y_um,map_x_um,map_y_um\n0,0,1,1\n5,5,6,six\n9,2,10,3\n",
            "no CSV of numbers in the columns x_um, y_um, map_x_um, map_y_um",
        ),
        ("x,y,u,v\n0,0,1,1\n5,5,6,6\n9,2,10,3\n", "no CSV of numbers in the columns x_um"),
        ("", "no CSV of numbers in the columns x_um"),
        (None, "f: &measurements ebsd_points: .*points.csv: is no CSV .*FileNotFound"),
    ],
)
def test_points_that_are_none(tmp_path, text, words):
    path = tmp_path / "points.csv"
    if text is not None:
        path.write_text(text)
    with pytest.raises(bi.InputError, match=words):
        registered(tmp_path, [(2.0, 5.0)], path)


def test_points_need_a_map(tmp_path):
    with pytest.raises(bi.InputError, match="ebsd: the variable is missing; ebsd_points needs it"):
        table = {"phi1_deg": [0.0], "Phi_deg": [0.0], "phi2_deg": [0.0], "Er": [200.0], "sd": [4.0]}
        bi.Problem.from_keywords(
            "f",
            {"measurements": table},
            problem={"symmetry": "cubic"},
            measurements={"ebsd_points": points_file(tmp_path / "points.csv")},
        )


def test_colours_are_those_of_the_inverse_pole_figure(tmp_path):
    x, y, euler = pixels()
    # The indenter along [001] on the left, along [011] on the right: red, and green, as every maker
    # has them.
    euler[:] = np.where((x < EDGE)[:, None], (20.0, 0.0, 30.0), (0.0, 45.0, 0.0))
    problem = measured(write(tmp_path / "map.h5", x, y, euler), [(2.0, 5.0)])
    colours = problem.map.grid.colours()
    assert colours[0] == pytest.approx([1, 0, 0], abs=0.02)
    assert colours[29].argmax() == 1 and colours[29][1] > 0.9 and colours[29][0] < 0.2


def test_the_picture_and_the_grains_of_the_indents(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "map.ang", *pixels())
    points_file(tmp_path / "points.csv")
    rows = "\n".join(
        f"g{k},{x:.6f},{y:.6f},{200 + k},4"
        for k, (x, y) in enumerate(stage_of([(2.1, 5.2), (12.3, 4.9), (3.0, 3.0)]))
    )
    (tmp_path / "grains.csv").write_text(f"grain,x_um,y_um,effective_modulus_gpa,sd_gpa\n{rows}\n")
    (tmp_path / "a.nml").write_text(
        "&problem symmetry = 'cubic' /\n"
        "&measurements file = 'grains.csv' ebsd = 'map.ang' ebsd_points = 'points.csv' /\n"
        "&surrogate file = 'halfspace' /\n"
        "&sampler samples = 100, burn_in = 200, chains = 1 /\n"
    )
    # The report has the same picture, with the key of its colours.
    assert main(["extract", "a.nml", "--output", "r"]) == 3
    axes = orientation_map(Results("r")).figure.axes[0]
    assert [key.name for key in axes.child_axes] == ["ipf"]
    capsys.readouterr()
    assert main(["map", "a.nml", "--output", "o", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    grains = [row["grain"] for row in document["results"]]
    assert grains[0] == grains[2] != grains[1]
    assert (tmp_path / "o" / "map.png").stat().st_size > 10_000
    assert document["results"][1]["map_x_um"] == pytest.approx(12.3, abs=1e-4)
    (tmp_path / "b.nml").write_text(
        "&problem symmetry = 'cubic' /\n"
        "&measurements file = 'grains.csv' /\n"
        "&surrogate file = 'halfspace' /\n"
    )
    assert main(["map", "b.nml"]) == 2


@pytest.mark.parametrize(
    ("places", "labels"),
    [
        ([(2.1, 5.2), (12.3, 4.9)], ["a", "b"]),
        ([(2.1, 5.2), (3.0, 3.0), (12.3, 4.9)], ["1", "2", "3"]),
    ],
)
def test_each_indent_has_its_own_label(tmp_path, places, labels):
    """Two indents in one grain are one measurement, whose name is not that of the next one."""
    grains = ["a", "b"] if len(places) == 2 else ["a", "a", "b"]
    problem = measured(write(tmp_path / "map.h5", *pixels()), places, grain=grains)
    axes = draw_map(problem.map, problem.measurements.names).figure.axes[0]
    found = {text.get_text(): text.xy for text in axes.texts}
    assert {label: tuple(found[label]) for label in labels} == dict(
        zip(labels, places, strict=True)
    ) and len(found) == len(labels)
