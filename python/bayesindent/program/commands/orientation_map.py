"""`map`: the picture of an orientation map with its indents."""

import argparse
from pathlib import Path

from ...common.result_files import whole_file
from ...core import InputError
from ...settings.problem import Problem
from ..command import Command, output_folder


def draw(arguments: argparse.Namespace) -> dict:
    """Draw the map to a file and list the grain of each indent."""
    problem = Problem(arguments.file, "extract")
    if problem.map is None:
        raise InputError(
            "the variable is missing; it is the orientation map, beside columns x_um and y_um",
            str(arguments.file),
            "measurements",
            "ebsd",
        )
    # Importing matplotlib is slow; other commands do without.
    from ...report.figures.maps import draw_map
    from ...report.figures.style import house_style, stamp_synthetic

    output = output_folder(arguments, arguments.file)
    with house_style():
        figure = draw_map(problem.map, problem.measurements.names).figure
        if problem.settings.problem.synthetic:
            stamp_synthetic(figure)
        with whole_file(output / "map.png") as file:
            figure.savefig(file, format="png")
    euler = problem.measurements.euler_deg.tolist()
    rows = [
        {"map_x_um": x, "map_y_um": y, "grain": grain}
        for (x, y), grain in zip(problem.map.positions.tolist(), problem.map.grains)
    ]
    if len(euler) == len(rows):
        rows = [row | {"euler_deg": angles} for row, angles in zip(rows, euler)]
    return {"file": str(output / "map.png"), "results": rows, "warnings": problem.warnings}


COMMANDS = (
    Command(
        "map",
        action=draw,
        arguments=lambda parser: parser.add_argument(
            "file", metavar="FILE.nml", type=Path, help="with &measurements file and ebsd"
        ),
        show=lambda document: print(
            f"Map: {document['file']}, {len(document['results'])} indents in "
            f"{len({row['grain'] for row in document['results']})} grains"
        ),
        then=lambda _, document: f"open {document['file']}",
    ),
)
