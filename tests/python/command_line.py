"""Commands that must fail."""

from __future__ import annotations

import os

from stretchmap.cli import main


def failing(capsys, *arguments):
    """Run a command that must fail; returns the exit code and the one line of error."""
    before = {p.name for p in os.scandir(".")}
    code = main(arguments)
    out, err = capsys.readouterr()
    assert {p.name for p in os.scandir(".")} == before, "a file was left behind"
    assert out == ""
    assert "Traceback" not in err and "internal error" not in err
    lines = [line for line in err.splitlines() if not line.startswith("stretchmap: warning: ")]
    assert len(lines) == 1 and lines[0].startswith("stretchmap: error: "), err
    return code, lines[0].removeprefix("stretchmap: error: ")
