"""No command replaces a file it is given, or one of its outputs by another."""

from __future__ import annotations

import inspect
import itertools
import typing
from pathlib import Path

import pytest

pytest.importorskip("typer")

from command_line import failing
from stretchmap.cli import GROUPS
from stretchmap.cli.app import application
from stretchmap.cli.replacing import Written, require_apart
from stretchmap.errors import OptionError

OUTPUTS = {"output", "json"}
COMMANDS = {
    info.name or info.callback.__name__: info.callback
    for info in application(GROUPS).registered_commands
}


def paths(command):
    """Names of all parameters that are paths, and of those that are marked as outputs."""
    hints = typing.get_type_hints(command, include_extras=True)
    plain = typing.get_type_hints(command)
    found = {name for name, hint in plain.items() if Path in (hint, *typing.get_args(hint))}
    marked = {name for name in found if "Written(" in repr(hints[name])}
    return found, marked


@pytest.mark.parametrize("command", COMMANDS)
def test_what_is_written_is_marked(command):
    found, marked = paths(COMMANDS[command])
    assert marked == found & OUTPUTS


@pytest.mark.parametrize("command", COMMANDS)
def test_no_output_is_another_file_of_the_call(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    Path("same.npz").write_bytes(b"kept")
    Path("nested").mkdir()
    call = COMMANDS[command]
    found, marked = paths(call)
    given = {name: each.default for name, each in inspect.signature(call).parameters.items()}
    given |= {name: Path(name) for name, value in given.items() if value is inspect.Parameter.empty}
    for one, other in itertools.combinations(sorted(found), 2):
        if {one, other} & marked:
            with pytest.raises(OptionError, match="would be replaced by the output"):
                call(**given | {one: Path("same.npz"), other: Path("nested/../same.npz")})
    assert Path("same.npz").read_bytes() == b"kept"


@pytest.fixture
def folders(tmp_path, monkeypatch):
    """Shapes, landmarks and a run."""
    monkeypatch.chdir(tmp_path)
    for name in ("pop/p0.npz", "pop/old.json", "marks/p0.csv", "run/mean.npz", "run/maps/p0-0.npz"):
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_bytes(b"kept")


RUN = ["population", "pop", "-o", "run", "--landmarks", "marks"]


@pytest.mark.parametrize(
    "arguments",
    [
        [*RUN, "--json", "pop/p0.npz"],
        [*RUN, "--json", "marks/p0.csv"],
        [*RUN, "--json", "run/report.html"],
        [*RUN, "--json", "run/maps/p0-0.npz"],
        [*RUN, "--template", "run/mean.npz"],
        ["demo", "-o", "run", "--json", "run/map.npz"],
        ["morph", "way_003.vtu", "-o", "way.pvd"],
    ],
)
def test_files_in_folders_count(folders, capsys, arguments):
    code, message = failing(capsys, *arguments)
    assert code == 2 and "would be replaced by the output" in message


def test_what_replaces_nothing_is_let_through(folders):
    population = COMMANDS["population"]
    given = {"solids": Path("pop"), "output": Path("run"), "max_rounds": 6}
    for report in ("pop/old.json", "pop/new.npz", "run/figures.json", "marks/old.json"):
        require_apart(population, given | {"landmarks": Path("marks"), "json": Path(report)})
    morph = COMMANDS["morph"]
    require_apart(morph, {"map_file": Path("a_000.vtu"), "output": Path("a.gif"), "frames": 3})
    require_apart(morph, {"map_file": Path("a_003.vtu"), "output": Path("a.pvd"), "frames": 3})


def test_a_mark_counts_where_a_default_makes_it_optional():
    def command(source: Path, target: typing.Annotated[Path, Written()] | None = None) -> None: ...

    with pytest.raises(OptionError, match="would be replaced"):
        require_apart(command, {"source": Path("a"), "target": Path("a")})
