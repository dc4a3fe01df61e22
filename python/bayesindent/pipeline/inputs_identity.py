"""What the documents of the stages follow from, so that results of other inputs are never taken for those of the present ones.

A document carries a digest of every input that it was made from: groups of the namelist, tables, the surrogate. The manifest of the output
folder (inputs.json) has the digests of the inputs last used there. A document belongs to them if all that both name are the same.
"""

import hashlib
import json
from contextlib import suppress
from pathlib import Path

from ..common.result_files import plain, read_json, write_json, write_text
from ..core import InputError
from ..settings.problem import stages
from ..surrogate.lookup import find_surrogate

__all__ = [
    "DOCUMENTS",
    "belongs",
    "inputs_of",
    "keep_document",
    "read_manifest",
    "read_resolved",
    "surrogate_input",
    "update_manifest",
    "write_resolved",
]

#: The file of each stage's document.
DOCUMENTS = {stage.name: stage.document for stage in stages() if stage.document}

MANIFEST = "inputs.json"

RESOLVED = "resolved.nml"

#: What no result follows from.
IMMATERIAL: dict[str, tuple[str, ...] | None] = {"problem": ("title",), "execution": None}


def inputs_of(problem, groups, output: Path) -> dict[str, str]:
    """Digests of these groups of a problem, with the tables and the surrogate that they name."""
    tables = {"crystals": problem.crystals, "measurements": problem.measurements, "design": problem.candidates, "next": problem.grains}
    cells = {name: table and [table.columns, table.rows] for name, table in tables.items()} | {"knowledge": problem.stiffness}
    inputs = {}
    for group in groups:
        immaterial = IMMATERIAL.get(group, ())
        if immaterial is not None:
            values = {name: value for name, value in vars(getattr(problem.settings, group)).items() if name not in ("given", *immaterial)}
            inputs[group] = digest(json.dumps([plain(values), cells.get(group)], sort_keys=True).encode())
    if "surrogate" in inputs:
        inputs |= surrogate_input(problem.settings.surrogate.file, output, problem.folder)
    return inputs


def surrogate_input(name: str, output: Path, folder) -> dict[str, str]:
    """The digest of a surrogate by its name, as it is now; nothing where there is none, as before a build."""
    with suppress(InputError):
        file = find_surrogate(name, output, folder)
        return {"surrogate_file": digest(file.read_bytes()) if file else ""}
    return {}


def keep_document(problem, stage: str, output: Path, document: dict) -> None:
    """Keep what a stage gave in the output folder, with the inputs that it follows from, for reports."""
    groups = next(row.groups for row in stages() if row.name == stage)
    document["warnings"] = list(document.get("warnings", []))
    document["inputs"] = inputs_of(problem, groups, output)
    update_manifest(output, problem.path, document["inputs"])
    write_json(output / DOCUMENTS[stage], document)


def digest(content: bytes) -> str:
    """A short name for a content."""
    return hashlib.sha256(content).hexdigest()[:16]


def read_manifest(folder: Path) -> dict:
    """The namelist and the inputs last used in a folder."""
    return read_json(folder / MANIFEST)


def update_manifest(folder: Path, namelist: Path, inputs: dict[str, str]) -> None:
    """Let these be the inputs last used; those that a stage does not need stay."""
    before = read_manifest(folder)
    write_json(folder / MANIFEST, before | {"namelist": str(Path(namelist).resolve()), "inputs": before.get("inputs", {}) | inputs})


def write_resolved(folder: Path, text: str) -> None:
    """Keep the namelist of the results with every default; the manifest knows it by its digest."""
    write_json(folder / MANIFEST, read_manifest(folder) | {"resolved": digest(text.encode())})
    write_text(folder / RESOLVED, text)


def read_resolved(folder: Path, manifest: dict) -> str:
    """The namelist of the results, '' where there is none. Raises `InputError` if it is not the one that the manifest is about."""
    file = folder / RESOLVED
    content = file.read_bytes() if file.exists() else b""
    if digest(content) != manifest.get("resolved", digest(content)):
        raise InputError(f"{file}: is not what the results beside it came from: another run replaced it, or it is damaged; run again")
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: is damaged ({error}); run again") from None


def belongs(document: dict, manifest: dict) -> bool:
    """Whether a document was made from the present inputs."""
    made_from, present = document.get("inputs", {}), manifest.get("inputs", {})
    return bool(made_from) and all(present.get(name, value) == value for name, value in made_from.items())
