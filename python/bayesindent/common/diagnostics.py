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


#: Severities and consequences, the most important first.
ORDER = (
    ("unusable", "warning", "note"),
    ("undetermined", "biased", "draws", "surrogate", "inputs"),
)


def distinct(found: Iterable[dict]) -> list[dict]:
    """The diagnostics without repetitions, by severity, then by consequence."""
    severities, consequences = ORDER
    return sorted(
        {message(each): each for each in found}.values(),
        key=lambda each: (
            severities.index(each["severity"]),
            consequences.index(each["consequence"]),
        ),
    )
