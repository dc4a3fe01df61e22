"""Provoke faults many times and count what was lost: kills, damaged files, a full disk, no
permission. The table is in docs/verification/faults.md.

Both programs: `bayesindent` and `bayesindent-batch`. Filling a disk needs the right to mount a
small one, and is left out without it.
"""

import argparse
import tempfile
from pathlib import Path

from support import fault_files, fault_kills

PROGRAMS = tuple(fault_kills.PROGRAMS)

#: Files of the results that are damaged, by program.
FILES = {
    "bayesindent": (
        "campaign.sqlite",
        "surrogate.txt",
        "posterior.bin",
        "build.json",
        "summary.json",
        "next.json",
        "inputs.json",
        "resolved.nml",
    ),
    "bayesindent-batch": ("campaign.sqlite", "surrogate.txt", "posterior.bin"),
}


def main(argv=None) -> int:
    """Provoke the faults and print the table; exit status 1 if anything was lost."""
    parser = argparse.ArgumentParser(
        prog="bench faults",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--only", choices=("kills", "files", "disk", "permission"), help="faults of this kind alone"
    )
    parser.add_argument("--program", choices=PROGRAMS, help="of this program alone")
    parser.add_argument("--kills", type=int, default=50, help="kills of a campaign (default 50)")
    parser.add_argument("--budget", type=int, default=40, help="its simulations (default 40)")
    parser.add_argument(
        "--repeats",
        type=int,
        default=3,
        help="how often a file is damaged in each of nine ways (default 3)",
    )
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args(argv)
    rows = []
    for program in PROGRAMS:
        if arguments.program not in (None, program):
            continue
        for kind, provoke in {
            "kills": kills,
            "files": files,
            "disk": disk,
            "permission": permission,
        }.items():
            if arguments.only in (None, kind):
                for row in provoke(program, arguments):
                    rows.append(row)
                    print(" | ".join(map(str, row)), flush=True)
    print(
        "\n| fault | how it was provoked | tries | what happened | losses |\n|---|---|---|---|---|"
    )
    for row in rows:
        print("| " + " | ".join(map(str, row)) + " |")
    return int(any(row[-1] for row in rows))


def kills(program: str, arguments):
    """Rows of the table for campaigns that are killed; of the batch program one in which a third of
    the simulations fails, too.
    """
    for geometry, batch in (("halfspace", 1), ("halfspace", 6), ("block", 6))[
        : 3 if program == "bayesindent-batch" else 2
    ]:
        with tempfile.TemporaryDirectory() as folder:
            campaign = {"geometry": geometry, "budget": arguments.budget, "batch": batch}
            found = fault_kills.disturbed(
                program, Path(folder), arguments.kills, arguments.seed, **campaign
            )
        losses = (
            found["lost"]
            + found["repeated"]
            + len(found["half-written files"])
            + len(found["other"])
        )
        happened = (
            f"{found['simulations']} simulations, {found['lost']} lost, {found['repeated']} "
            f"repeated; half-written files: {', '.join(found['half-written files']) or 'none'}; "
            f"other than undisturbed: {', '.join(found['other']) or 'nothing'}"
        )
        how = (
            f"`{program}`, {geometry}, `batch = {batch}`: SIGKILL to the group, "
            f"{found['inside a write']} of {found['kills']} inside a write"
        )
        yield "kill", how, found["kills"], happened, losses
    for command in ("report", "compare", "init") if program == "bayesindent" else ():
        with tempfile.TemporaryDirectory() as folder:
            found = fault_files.killed(command, Path(folder), arguments.kills // 5, arguments.seed)
        yield (
            "kill",
            f"`{program} {command}`: SIGKILL to the group",
            found["tries"],
            *told(found, "not whole afterwards"),
        )


def files(program: str, arguments):
    """Rows for files that are damaged."""
    seeds = range(arguments.seed, arguments.seed + arguments.repeats)
    for file in FILES[program]:
        with tempfile.TemporaryDirectory() as folder:
            found = fault_files.damaged(program, Path(folder), file, seeds)
        how = (
            f"`{program}`: `{file}` emptied, cut short, bits and bytes changed, zeros, another file"
        )
        yield "damaged file", how, found["tries"], *told(found, "exit 2 and one line that names it")


def disk(program: str, arguments):
    """Rows for a disk that is full."""
    found = fault_files.full_disk(program, range(0, 8 * arguments.repeats, 4))
    if found["tries"]:
        how = (
            f"`{program}`: 0 to {8 * arguments.repeats - 4} kB left, before the first run and "
            "before the next"
        )
        yield (
            "full disk",
            how,
            found["tries"],
            *told(found, "exit 1 and one line that says so; whole with room again"),
        )


def permission(program: str, _arguments):
    """Rows for a folder and a campaign that may not be written."""
    with tempfile.TemporaryDirectory() as folder:
        found = fault_files.no_permission(program, Path(folder))
    how = f"`{program}`: results that another user owns, and `campaign.sqlite` alone"
    yield "no permission", how, found["tries"], *told(found, "exit 1 and one line that names it")


def told(found: dict, words: str) -> tuple[str, int]:
    """What happened in how many tries, and how many went wrong."""
    happened = f"{found['refused']}: {words}; {found['same']}: the same numbers"
    for line in found["wrong"]:
        print("   ", line, flush=True)
    return happened, len(found["wrong"])
