"""Tutorials as executed notebooks: the cells of a page, what they print, and the pictures that they
draw.

PYTHONPATH=tests python -m tools.notebooks own_table curves        writes
docs/tutorials/own_table.ipynb and curves.ipynb
"""

import base64
import contextlib
import io
import json
import os
import re
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
TUTORIALS = ROOT / "docs" / "tutorials"


def cells(text: str) -> list[tuple[str, str]]:
    """Kind ('markdown', 'python', 'text': what the cell before it prints) and text of each part of
    a page.
    """
    found = []
    for part in re.split(r"^(```(?:python|text)\n.*?^```\n)", text, flags=re.M | re.S):
        block = re.fullmatch(r"```(python|text)\n(.*?)\n```\n", part, flags=re.S)
        if block:
            found.append((block[1], block[2]))
        elif part.strip():
            found.append(("markdown", part.strip()))
    return found


def executed(page: Path) -> dict:
    """Run a page in the current folder; return its notebook."""
    names: dict = {"__name__": "tutorial"}
    made: list[dict] = []
    for number, (kind, text) in enumerate(cells(page.read_text(encoding="utf-8"))):
        if kind == "text":
            continue
        cell: dict = {
            "cell_type": "markdown",
            "id": f"cell-{number}",
            "metadata": {},
            "source": text.splitlines(keepends=True),
        }
        if kind == "python":
            before = {path.name for path in Path().glob("*.png")}
            with contextlib.redirect_stdout(io.StringIO()) as printed:
                exec(text, names)
            outputs: list[dict] = []
            if printed.getvalue():
                outputs.append(
                    {
                        "name": "stdout",
                        "output_type": "stream",
                        "text": printed.getvalue().splitlines(keepends=True),
                    }
                )
            for picture in sorted({path.name for path in Path().glob("*.png")} - before):
                data = base64.b64encode(Path(picture).read_bytes()).decode("ascii")
                outputs.append(
                    {"data": {"image/png": data}, "metadata": {}, "output_type": "display_data"}
                )
            cell |= {
                "cell_type": "code",
                "execution_count": 1 + sum(c["cell_type"] == "code" for c in made),
                "outputs": outputs,
            }
        made.append(cell)
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return {"cells": made, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}


def main() -> None:
    """Run the pages that are named, and write their notebooks."""
    for name in sys.argv[1:]:
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            Path("data").symlink_to(ROOT / "inputs" / "data")
            notebook = executed(TUTORIALS / f"{name}.md")
        (TUTORIALS / f"{name}.ipynb").write_text(
            json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
        )


if __name__ == "__main__":
    main()
