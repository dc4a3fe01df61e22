"""What the documents of the stages follow from, so that results of other inputs are never taken for those of the present ones.

A document carries a digest of every input that it was made from: groups of the namelist, tables, the surrogate. The manifest of the output
folder (inputs.json) has the digests of the inputs last used there. A document belongs to them if all that both name are the same.
"""

import hashlib
import json
from contextlib import suppress
from pathlib import Path

from ..common.result_files import plain, read_json, write_json
from ..core import InputError
from ..settings.problem import stages
from ..surrogate.lookup import find_surrogate

__all__ = ["DOCUMENTS", "belongs", "inputs_of", "read_manifest", "update_manifest"]

#: The file of each stage's document.
DOCUMENTS = {stage.name: stage.document for stage in stages() if stage.document}

MANIFEST = "inputs.json"

#: What no result follows from.
IMMATERIAL: dict[str, tuple[str, ...] | None] = {"problem": ("title",), "execution": None}


def inputs_of(problem, groups, output: Path) -> dict[str, str]:
    """Digests of these groups of a problem, with the tables and the surrogate that they name."""
    tables = {"crystals": problem.crystals, "measurements": problem.measurements, "design": problem.candidates}
    cells = {name: table and [table.columns, table.rows] for name, table in tables.items()} | {"knowledge": problem.stiffness}
    inputs = {}
    for group in groups:
        immaterial = IMMATERIAL.get(group, ())
        if immaterial is not None:
            values = {name: value for name, value in vars(getattr(problem.settings, group)).items() if name not in ("given", *immaterial)}
            inputs[group] = digest(json.dumps([plain(values), cells.get(group)], sort_keys=True).encode())
    # Before a build there is none.
    with suppress(InputError):
        if "surrogate" in inputs:
            file = find_surrogate(problem.settings.surrogate.file, output, problem.folder)
            inputs["surrogate_file"] = digest(file.read_bytes()) if file else ""
    return inputs


def digest(content: bytes) -> str:
    """A short name for a content."""
    return hashlib.sha256(content).hexdigest()[:16]


def read_manifest(folder: Path) -> dict:
    """The namelist and the inputs last used in a folder."""
    return read_json(folder / MANIFEST)


def update_manifest(folder: Path, namelist: Path, inputs: dict[str, str]) -> None:
    """Let these be the inputs last used; those that a stage does not need stay."""
    before = read_manifest(folder).get("inputs", {})
    write_json(folder / MANIFEST, {"namelist": str(Path(namelist).resolve()), "inputs": before | inputs})


def belongs(document: dict, manifest: dict) -> bool:
    """Whether a document was made from the present inputs."""
    made_from, present = document.get("inputs", {}), manifest.get("inputs", {})
    return bool(made_from) and all(present.get(name, value) == value for name, value in made_from.items())
