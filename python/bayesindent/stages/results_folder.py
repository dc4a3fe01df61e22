"""Read a folder of results: its manifest, the resolved namelist, the documents and the numbers of
Step 2. The core writes and verifies them.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..common.diagnostics import diagnostic
from ..common.result_files import read_json
from ..core import BayesindentError, InputError, call
from ..settings.problem import Problem, stages
from ..surrogate.surrogate import places

#: The file of each stage's document.
DOCUMENTS = {stage.name: stage.document for stage in stages() if stage.document}
#: The namelist and the inputs last used in a folder.
MANIFEST = "inputs.json"
#: Version of the form of documents, see fortran/stages/abstract_stage.f90.
FORMAT = 2


def read_resolved(folder: Path) -> str:
    """The resolved namelist of the results, '' if there is none. Raises `InputError` if its digest
    is not the one in the manifest.
    """
    try:
        return (
            call("file.read_resolved", folder=folder)["text"]
            .encode("utf-8", "surrogateescape")
            .decode()
        )
    except UnicodeDecodeError as error:
        raise InputError(f"{folder / 'resolved.nml'}: is damaged ({error}); run again") from None


def read_posterior(folder: Path) -> dict:
    """The numbers of Step 2 by name, see fortran/documents/analysis_document.f90; empty if there
    are none.
    """
    return call("file.read_posterior", folder=folder) if (folder / "posterior.bin").exists() else {}


def read_document(folder: Path, name: str) -> dict:
    """The document of a stage, or the manifest, in a folder; an empty one if there is no file.
    Raises `InputError` for a document of another version of the program.
    """
    path = folder / DOCUMENTS.get(name, name)
    document = read_json(path)
    if document and name in DOCUMENTS and document.get("format") != FORMAT:
        raise InputError(
            f"{path}: is of an earlier version of the program; run the command that wrote it "
            f"again, bayesindent {name} or bayesindent run"
        )
    return document


@contextmanager
def using_documents(*folders: Path) -> Iterator[None]:
    """Refuse documents whose checksums are right but whose values another program wrote."""
    try:
        yield
    except (BayesindentError, OSError, MemoryError):
        raise
    except Exception as error:
        files = [each / file for each in folders for file in (MANIFEST, *DOCUMENTS.values())]
        found = ", ".join(str(file) for file in files if file.exists())
        raise InputError(
            f"{found}: one of these has other values than this version of the program writes "
            f"({type(error).__name__}: {error}); bayesindent run makes it anew"
        ) from error


def surrogate_digest(name: str, folder: Path, namelist_folder: Path) -> dict[str, str]:
    """The present digest of a surrogate by its name; empty if there is none, as before a build."""
    try:
        return {
            "surrogate_file": call(
                "file.digest_surrogate", name=name, **places(folder, namelist_folder)
            )["text"]
        }
    except InputError:
        return {}


def changed_inputs(folder: Path, manifest: dict, problem: Problem | None) -> list[dict]:
    """A diagnostic for each group of the namelist last used in a folder, which states the
    `problem`, that was edited since, or whose tables were.
    """
    if problem is None:
        return []
    now = json.loads(problem._call("inputs", **places(folder, problem.folder))["text"])
    # Options of the command may have stated the others.
    return [
        diagnostic("inputs_edited", f"&{name} of {manifest['namelist']}")
        for name, digest in manifest["inputs"].items()
        if name not in ("problem", "sampler", "surrogate_file") and now.get(name, digest) != digest
    ]


def belongs(document: dict, manifest: dict) -> bool:
    """Whether a document was made from the present inputs."""
    made_from, present = document.get("inputs", {}), manifest.get("inputs", {})
    return bool(made_from) and all(
        present.get(name, value) == value for name, value in made_from.items()
    )
