"""README and first pages hold what they promise: snippets run, commands exist, links lead on."""

from __future__ import annotations

import importlib.util
import re
import shlex
from pathlib import Path

import pytest

from stretchmap.cli import GROUPS, main

ROOT = Path(__file__).resolve().parents[3]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language, text=README):
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.M | re.S)


def test_the_readme_is_one_screen_with_two_commands():
    assert len(README.splitlines()) <= 70
    assert len(blocks("sh")) == 2 and README.count("![") == 1


@pytest.mark.parametrize(
    ("page", "count", "files"),
    [
        ("README.md", 1, {"part_map.npz"}),
        ("docs/quickstart.md", 3, {"part_map.npz", "part.png"}),
    ],
)
def test_python_snippets_run_one_after_the_other(page, count, files, tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    snippets = blocks("python", (ROOT / page).read_text(encoding="utf-8"))
    assert len(snippets) == count
    for snippet in snippets:
        exec(compile(snippet, page, "exec"), names)
    assert files <= {p.name for p in tmp_path.iterdir()}
    assert "certified" in capsys.readouterr().out


def test_ci_runs_the_readmes_test_command():
    demo, tests = (block.strip() for block in blocks("sh"))
    assert "\n" not in demo and "\n" not in tests
    assert tests.endswith("-m pytest") and demo.endswith("stretchmap demo")
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert script.splitlines().count(tests) == 1


def test_every_command_of_the_table_exists(capsys):
    typer = pytest.importorskip("typer")
    from stretchmap.cli.app import application

    page = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    commands = {line.split()[1] for line in re.findall(r"`(stretchmap [a-z][^`]*)`", page)}
    assert commands == set(typer.main.get_command(application(GROUPS)).commands)
    for command in commands:
        assert main([command, "--help"]) == 0
        help_text = capsys.readouterr().out
        for line in re.findall(rf"`(stretchmap {command}\b[^`]*)`", page):
            for option in shlex.split(line.replace("[", " ").replace("]", " ")):
                if option.startswith("-"):
                    assert re.search(rf"(^|[\s,]){option}\b", help_text), f"{command} {option}"


def test_every_extra_is_listed_with_its_licenses():
    tomllib = pytest.importorskip("tomllib")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    page = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \|[^|]+\| [^|]+ \|$", page, re.M)
    extras = project["optional-dependencies"].keys() - {"bench", "test", "docs", "all"}
    assert set(rows) == extras and len(rows) == len(extras)


PAGES = sorted(
    page.relative_to(ROOT).as_posix()
    for folder in (".", "bench", "docs", "tests")
    for page in (ROOT / folder).glob("*.md")
)


def anchors(page):
    """What the headings of a page are linked by."""
    headings = re.findall(r"^#+ +(.+)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES)
def test_local_links_lead_somewhere(page):
    text = re.sub(r"```.*?```|`[^`]*`", "", (ROOT / page).read_text(encoding="utf-8"), flags=re.S)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if "://" in target or target.startswith("mailto:"):
            continue
        path, _, anchor = target.partition("#")
        file = (ROOT / page).parent / path if path else ROOT / page
        # The gallery and its like are pages of the site only.
        assert file.exists() or file.parts[-2] in ("gallery", "tutorials", "api"), target
        if anchor and file.suffix == ".md":
            assert anchor in anchors(file), target


def test_the_picture_is_small_and_can_be_drawn_again(tmp_path):
    pytest.importorskip("matplotlib")
    picture = ROOT / "docs" / "map.png"
    assert picture.stat().st_size < 300_000
    spec = importlib.util.spec_from_file_location("pictures", ROOT / "docs" / "make_pictures.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    drawn = module.main(n_tets=6_000, folder=tmp_path)
    assert drawn.read_bytes().startswith(b"\x89PNG")
