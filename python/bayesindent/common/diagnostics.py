"""Diagnostics of docs/diagnostics.md: the warnings of documents, made by the core."""

import json
from collections.abc import Iterable

from ..core import call


def diagnostic(code: str, subject: str = "") -> dict:
    """A diagnostic without numbers."""
    (found,) = json.loads(call("settings.diagnostic", code=code, subject=subject)["text"])
    return found


def message(found: dict) -> str:
    """The sentence and the remedy of a diagnostic."""
    return ". ".join(filter(None, (found["text"], found["remedy"])))


def labelled(found: dict) -> str:
    """The message of a diagnostic after its severity."""
    severity = "the result cannot be used" if is_unusable(found) else found["severity"]
    return f"{severity}: {message(found)}"


def is_unusable(found: dict) -> bool:
    """Whether a result with this diagnostic cannot be used."""
    return found["severity"] == "unusable"


def distinct(found: Iterable[dict]) -> list[dict]:
    """The diagnostics without repetitions."""
    return list({message(each): each for each in found}.values())
