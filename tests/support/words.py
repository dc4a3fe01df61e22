"""The words of a choice, from the schema of the program."""

from bayesindent.settings.problem import schema

__all__ = ["words"]


def words(group: str, name: str) -> list[str]:
    """The words that a variable of a namelist may have."""
    (variable,) = (one for one in schema() if (one.group, one.name) == (group, name))
    return [word.strip(" '") for word in variable.allowed.split(",")]
