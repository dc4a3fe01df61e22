"""Every operation of the facade is declared with its values, and the package uses it. All calls of
the other tests are compared with these declarations, see tests/support/declared_operations.py.
"""

import pytest

from bayesindent import core
from support.declared_operations import within
from support.tree import SOURCE
from tools.operations import operations

DECLARED = operations(SOURCE)
PACKAGE = "\n".join(
    path.read_text() for path in sorted((SOURCE / "python" / "bayesindent").rglob("*.py"))
)
#: Kinds of operation that need no object.
FREE = ("crystal", "settings", "file")


@pytest.mark.parametrize("name", DECLARED)
def test_the_package_uses_every_operation(name):
    kind, _, verb = name.partition(".")
    assert f'"{name if kind in FREE else verb}"' in PACKAGE


def test_calls_are_compared_with_the_declarations():
    with pytest.raises(AssertionError, match="has no value {'more'}"):
        core.call("crystal.class", symmetry="cubic", more=1)
    with pytest.raises(AssertionError, match="has no value {'name'}"):
        within(b"crystal.class", {"name": "cubic"}, ("constants",))
    with pytest.raises(core.InputError, match="no operation is named none"):
        core.call("crystal.none")
