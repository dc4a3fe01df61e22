"""The paper by one command: both case studies from finite elements to posteriors, the arms that
test its claim, and one page with each equation, figure and table beside ours.

The folder keeps what is computed. After a kill the same command resumes.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

from bayesindent.common.progress import show_progress
from bayesindent.report.figures.style import house_style
from reproduction import run
from reproduction.report import make_page
from support.tree import SOURCE

PLANS = {"whole": run.WHOLE, "quick": run.QUICK, "tiny": run.TINY}


def main(argv: list[str] | None = None) -> int:
    """Compute what is missing; write the page."""
    parser = argparse.ArgumentParser(prog="bayesindent reproduce", description=__doc__)
    parser.add_argument(
        "--quick", action="store_true", help="fewer simulations and seeds: at most 4 CPU minutes"
    )
    parser.add_argument("--plan", choices=PLANS, help=argparse.SUPPRESS)
    parser.add_argument("--output", metavar="DIR", type=Path, help="default: runs/reproduce")
    parser.add_argument(
        "--workers", type=int, default=0, metavar="N", help="simulations at a time (0: all cores)"
    )
    parser.add_argument("--json", action="store_true", help="the numbers on standard output")
    parser.add_argument("--quiet", action="store_true", help="no progress on standard error")
    parser.add_argument(
        "--docs", action="store_true", help="write docs/verification/paper.md and its figures"
    )
    arguments = parser.parse_args(argv)
    plan = PLANS[arguments.plan or ("quick" if arguments.quick else "whole")]
    folder = arguments.output or Path("runs") / f"reproduce{'_quick' if plan.is_quick else ''}"
    folder = folder.absolute()
    show_progress(not arguments.quiet)
    results = run.perform(folder, plan, arguments.workers, arguments.quiet)
    with house_style():
        page = make_page(results, commit())
        page.write_html(folder / "report.html")
        if arguments.docs:
            page.write_markdown(SOURCE / "docs" / "verification" / "paper.md")
    if arguments.json:
        print(json.dumps(page.numbers))
    if not arguments.quiet:
        print(f"the page is {folder / 'report.html'}", file=sys.stderr)
    return 0


def commit() -> str:
    """The commit of the source tree, '' outside a repository."""
    command = ["git", "-C", str(SOURCE), "rev-parse", "--short", "HEAD"]
    try:
        found = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return found.stdout.strip()


if __name__ == "__main__":
    os.environ.setdefault("BAYESINDENT_SOURCE", str(Path(__file__).parents[2]))
    sys.exit(main())
