"""Single-crystal elastic constants, with honest uncertainty, from spherical indentation of single
grains.

`bi.extract(table, "cubic")` infers the constants from a table of grains. `bi.summary`, `bi.report`,
`bi.compare`, `bi.next_grain` and the plots take its result. help(bi.extract) lists every keyword.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .version import __version__ as __version__

if TYPE_CHECKING:
    from .interface import *  # noqa: F403


def __getattr__(name: str) -> Any:
    """Import the public names at their first use: numpy and the core take a tenth of a second."""
    if name == "__all__" or not name.startswith("_"):
        interface = import_module(".interface", __name__)
        globals().update(
            {offered: getattr(interface, offered) for offered in interface.__all__},
            __all__=interface.__all__,
        )
        if name in globals():
            return globals()[name]
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted([*__getattr__("__all__"), "__doc__", "__version__"])
