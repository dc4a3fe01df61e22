"""Exact versions with hashes of all packages of Python that the launcher installs, in
`requirements/`.

`wheel --lock` makes the files from the bounds of pyproject.toml: `build.txt`, `run.txt`, and one
for each extra with what it needs beyond `run.txt`. They serve every Python from 3.10 on.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import tomllib
except ImportError:  # Python 3.10
    from pip._vendor import tomli as tomllib  # type: ignore[no-redef]

ROOT = Path(__file__).parents[2]
#: The folder in which pip installs programs of this environment.
TOOLS = Path(sys.executable).parent
FOLDER = ROOT / "requirements"
HEADER = "# Made by `./bayesindent dev wheel --lock` from pyproject.toml.\n"


def write_locks() -> None:
    """Write all files anew, with the latest versions that suit each other."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    run = settings["project"]["dependencies"]
    extras = settings["project"]["optional-dependencies"]
    build = settings["build-system"]["requires"]
    versions = resolved([*build, *run, *(name for names in extras.values() for name in names)])
    wanted = {"build": {*resolved(build, versions)}, "run": {*resolved(run, versions)}}
    for extra, names in extras.items():
        wanted[extra] = {*resolved([*run, *names], versions)} - wanted["run"]
    FOLDER.mkdir(exist_ok=True)
    for name, packages in wanted.items():
        text = "".join(versions[package] for package in sorted(packages))
        (FOLDER / f"{name}.txt").write_text(HEADER + text)
        print(f"requirements/{name}.txt: {len(packages)} packages", file=sys.stderr)


def resolved(requirements: list[str], versions: dict[str, str] | None = None) -> dict[str, str]:
    """The lines of each package that the requirements need, by its name; with the `versions` of an
    earlier call, if there are any.
    """
    with tempfile.TemporaryDirectory() as folder:
        wanted, constraints = Path(folder, "wanted.in"), Path(folder, "constraints.txt")
        wanted.write_text("\n".join(requirements))
        constraints.write_text("".join((versions or {}).values()))
        command: list[str | Path] = [
            *(TOOLS / "uv", "pip", "compile", "--quiet", "--universal", "--python-version", "3.10"),
            *("--generate-hashes", "--no-annotate", "--no-header"),
            *("--constraint", str(constraints), str(wanted)),
        ]
        text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    blocks: dict[str, str] = {}
    for block in re.split(r"^(?=\S)", text, flags=re.MULTILINE):
        name = block.split("==")[0]
        if name:
            blocks[name] = blocks.get(name, "") + block
    return blocks
