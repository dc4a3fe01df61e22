"""The map of the folders of fortran/ and python/bayesindent/: arrows lead to the folders that a
folder uses.
"""

import ast
import re
from collections import Counter
from pathlib import Path

from tools.lines import statements

#: Each folder uses only those before it.
LAYERS = (
    "common",
    "engines",
    "crystal",
    "settings",
    "observables",
    "tables",
    "problem",
    "theory",
    "curves",
    "fe",
    "simulation",
    "surrogate",
    "inference",
    "rivals",
    "campaign",
    "analysis",
    "training",
    "documents",
    "stages",
    "report",
    "facade",
    "program",
)
WIDTH, STEP, BOX = 300, 66, (170, 34)


def draw(root: Path, file: Path) -> None:
    """Write the map of both languages side by side."""
    graphs = {
        "fortran": fortran_graph(root / "fortran"),
        "python/bayesindent": python_graph(root / "python" / "bayesindent"),
    }
    parts, height = [], 0
    for column, (title, (sizes, uses)) in enumerate(graphs.items()):
        used = [name for name in LAYERS if name in sizes]
        height = max(height, 60 + STEP * len(used))
        parts += column_of(title, used, sizes, uses, 60 + column * (WIDTH + 200))
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {2 * WIDTH + 260} {height}" '
        'font-family="sans-serif" font-size="13">'
    )
    arrow = (
        '<marker id="a" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" markerHeight="7" '
        'orient="auto"><path d="M0 0 8 4 0 8z"/></marker>'
    )
    file.write_text("\n".join([head, f"<defs>{arrow}</defs>", *parts, "</svg>\n"]))


def fortran_graph(folder: Path) -> tuple[Counter, Counter]:
    """Modules of each folder, and of each pair of folders the modules of the first that use the
    second.
    """
    home = {path.stem: path.parent.name for path in folder.rglob("*.f90")}
    uses: Counter = Counter()
    for path in folder.rglob("*.f90"):
        found = (
            re.match(r"use\b(?:\s*,[^:]*)?(?:\s*::)?\s*(\w+)", line)
            for _, _, line in statements(path.read_text())
        )
        uses.update(
            {(path.parent.name, home[match[1]]) for match in found if match and match[1] in home}
        )
    return Counter(home.values()), uses


def python_graph(package: Path) -> tuple[Counter, Counter]:
    """The same for the sub-packages."""
    sizes: Counter = Counter()
    uses: Counter = Counter()
    for path in package.rglob("*.py"):
        parts = path.relative_to(package).parts
        if len(parts) == 1:
            continue
        sizes[parts[0]] += path.name != "__init__.py"
        nodes = [
            node
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.ImportFrom) and node.level == len(parts)
        ]
        uses.update(
            {
                (parts[0], node.module.split(".")[0])
                for node in nodes
                if node.module and node.module.split(".")[0] in LAYERS
            }
        )
    return sizes, uses


def column_of(title: str, names: list[str], sizes: Counter, uses: Counter, left: int) -> list[str]:
    """Boxes below each other, the user above what it uses, and an arc for each pair of folders."""
    top = {name: 40 + STEP * row for row, name in enumerate(reversed(names))}
    width, height = BOX
    parts = [
        f'<text x="{left + width / 2}" y="22" text-anchor="middle" '
        f'font-weight="bold">{title}</text>'
    ]
    for name in names:
        parts.append(
            f'<rect x="{left}" y="{top[name]}" width="{width}" height="{height}" rx="5" '
            'fill="#eef3f8" stroke="#456"/>'
        )
        parts.append(
            f'<text x="{left + width / 2}" y="{top[name] + 22}" text-anchor="middle">{name} '
            f"({sizes[name]})</text>"
        )
    for (user, used), count in sorted(uses.items()):
        if user == used or user not in top or used not in top:
            continue
        start, end = top[user] + height * 0.75, top[used] + height * 0.25
        right, bulge = left + width, 14 + 15 * (names.index(user) - names.index(used))
        parts.append(
            f'<path d="M{right} {start} C{right + bulge} {start} {right + bulge} {end} {right} '
            f'{end}" fill="none" stroke="#567" '
            f'stroke-width="{min(3, 0.6 + count / 8):.1f}" marker-end="url(#a)"><title>{user} '
            f"uses {used}: {count} modules</title></path>"
        )
    return parts
