"""The typer application, put together from the groups of commands."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import Annotated

import typer

from .._version import __version__
from .replacing import keeping_inputs


def application(groups: Sequence[str]) -> typer.Typer:
    """The application with the commands of these modules of the package."""
    app = typer.Typer(
        name="stretchmap",
        help="Volume-preserving maps of solids with a hole onto the standard solid torus.",
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback(invoke_without_command=True)(_start)
    for group in groups:
        importlib.import_module(f"{__package__}.{group}").register(app)
    for command in app.registered_commands:
        assert command.callback is not None
        command.callback = keeping_inputs(command.callback)
    return app


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"stretchmap {__version__}")
        raise typer.Exit


def _start(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())
