"""The command ``stretchmap``.

Every group of commands is a module of this package with one function ``register(app)`` that adds
its commands to the typer application; `GROUPS` lists the modules. Commands only read, call the
library, print and write. They raise what the library raises: :func:`main` turns every exception
into one sentence on standard error and an exit code.

========= ==================================================================
exit code meaning
========= ==================================================================
0         success
1         the computation failed, or a map is not certified
2         bad input or bad usage
130       interrupted, by Ctrl-C, SIGTERM or SIGHUP
========= ==================================================================
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

__all__ = ["GROUPS", "main"]

GROUPS = ("meshes", "maps", "volumes", "pictures", "applications", "populations", "doctor")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        Arguments after the program's name, those of the process by default.

    Returns
    -------
    int
        Exit code.
    """
    from .guard import guarded

    given = sys.argv[1:] if arguments is None else list(arguments)
    return guarded(lambda: _run(given))


def _run(arguments: list[str]) -> object:
    from ..errors import MissingDependencyError

    try:
        import rich  # noqa: F401
        import typer  # noqa: F401
    except ImportError as error:
        raise MissingDependencyError(
            f"the command line needs {error.name}: pip install 'stretchmap[cli]'"
        ) from None
    from .app import application

    return application(GROUPS)(args=arguments, prog_name="stretchmap", standalone_mode=False)
