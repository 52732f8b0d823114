"""The command itself: its help, its groups, its guard over errors, the package run as a module."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

import stretchmap as sm
from stretchmap.cli import GROUPS, main
from stretchmap.cli.guard import guarded, in_words_of_the_command_line

pytest.importorskip("typer")

# Processes of their own find the package wherever this one did.
ENV = {**os.environ, "PYTHONPATH": str(Path(sm.__file__).parents[1])}


def test_help_names_every_command_and_version(capsys):
    assert main([]) == 0
    out = capsys.readouterr().out
    assert "..." not in out.split("Commands:")[1]
    for command in ("info", "homology", "tet", "conformal", "area", "volume", "certify", "plot",
                    "report", "demo", "coordinates", "register", "partition", "resample",
                    "morph", "prepare", "fill", "doctor"):  # fmt: skip
        assert f"\n  {command} " in out
        assert main([command, "--help"]) == 0
    capsys.readouterr()
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip() == f"stretchmap {sm.__version__}"


def test_groups_are_modules_with_register():
    import importlib

    for group in GROUPS:
        assert callable(importlib.import_module(f"stretchmap.cli.{group}").register)


def test_python_words_become_options():
    text = "pass orient=True, or method='certified' (keep_best=True); compact() does"
    assert in_words_of_the_command_line(text) == (
        "pass --orient, or --method certified (--keep-best); --compact does"
    )


@pytest.mark.parametrize(
    ("number", "code"),
    [(errno.ENOSPC, 1), (errno.EFBIG, 1), (errno.EMFILE, 1), (errno.ENOMEM, 1), (errno.ENOENT, 2)],
)
def test_what_the_machine_has_no_room_for_is_no_bad_input(number, code):
    def fails():
        raise OSError(number, os.strerror(number), "out.npz")

    assert guarded(fails) == code


def test_unexpected_errors_are_one_line_too(capsys, monkeypatch):
    monkeypatch.delenv("STRETCHMAP_DEBUG", raising=False)

    def broken():
        raise ZeroDivisionError("two\nlines")

    assert guarded(broken) == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_without_typer_the_pip_line_and_exit_2():
    script = (
        "import sys; sys.modules['typer'] = None\n"
        "from stretchmap.cli import main; sys.exit(main(['info', 'x']))"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=ENV)
    assert run.returncode == 2
    assert "pip install 'stretchmap[cli]'" in run.stderr and run.stderr.count("\n") == 1


def test_the_package_run_as_a_module_is_the_command(folder):
    command = [sys.executable, "-m", "stretchmap"]
    run = subprocess.run([*command, "--version"], capture_output=True, text=True, env=ENV)
    assert run.returncode == 0 and run.stdout == f"stretchmap {sm.__version__}\n", run.stderr
    run = subprocess.run([*command, "info", "nosuch.npz"], capture_output=True, text=True, env=ENV)
    assert run.returncode == 2
    assert run.stderr.startswith("stretchmap: error: ") and run.stderr.count("\n") == 1


def test_importing_the_package_loads_nothing_heavy():
    script = (
        "import sys, stretchmap, stretchmap.cli\n"
        "heavy = {'scipy', 'matplotlib', 'pyvista', 'meshio', 'typer', 'rich'}\n"
        "sys.exit(', '.join(heavy & sys.modules.keys()) or 0)"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=ENV)
    assert run.returncode == 0, run.stderr
