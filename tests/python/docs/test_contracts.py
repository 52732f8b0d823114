r"""Declarations of the core say what they take, give and refuse: \param, \return, \throws, \pre.

Counted are functions, constructors and methods that a header offers; one-line members that need no
more than their name are not.
"""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
INCLUDE = ROOT / "cpp" / "include"
TAG = re.compile(r"\\(t?param|return|throws|pre)\b")
SCOPE = re.compile(r"\b(namespace|class|struct|enum)\b")
ASIDE = re.compile(r"= default|\boverride\b|^\s*using\b|\balignas\b|^[^(]* = |~")
LEAST_SHARE = 0.75


def declarations(text: str) -> list[tuple[str, str]]:
    """Each declaration on offer, with the comment of the paragraph it stands in."""
    text = re.sub(r"^#.*(?:\\\n.*)*", "", text, flags=re.MULTILINE).replace(" = {}", "")
    found, scopes, comment, statement = [], [], "", ""
    for line in text.splitlines():
        code, _, remark = line.partition("//")
        if not line.strip():
            comment = ""
        if not code.strip():
            comment += remark
            continue
        hidden = "body" in scopes or "private" in scopes
        if re.match(r"\s*(public|private|protected):", code):
            scopes[-1] = "open" if "public" in code else "private"
            continue
        for char in code:
            if char == "{":
                kind = SCOPE.search(statement)
                whole = not hidden and "(" in statement and not kind
                if whole and not code.rstrip().endswith("}"):
                    found.append((comment, statement))
                inner = {"class": "private"}.get(kind[1], "open") if kind else "body"
                scopes.append(inner)
                hidden = "body" in scopes or "private" in scopes
                statement = ""
            elif char == "}":
                scopes.pop()
                hidden = "body" in scopes or "private" in scopes
                statement = ""
            elif char == ";":
                if not hidden and re.search(r"\w\(", statement) and not ASIDE.search(statement):
                    found.append((comment, statement))
                statement = ""
            else:
                statement += char
    return found


def test_most_declarations_of_the_core_state_their_contract() -> None:
    rows = [
        (path.relative_to(INCLUDE), comment, " ".join(statement.split()))
        for path in sorted(INCLUDE.rglob("*.hpp"))
        for comment, statement in declarations(path.read_text())
    ]
    without = [
        f"{path}: {statement}" for path, comment, statement in rows if not TAG.search(comment)
    ]
    share = 1.0 - len(without) / len(rows)
    assert share >= LEAST_SHARE, f"{share:.0%} of {len(rows)}; without:\n" + "\n".join(without)


def test_functions_cloned_for_processors_are_compiled_without_contraction_and_apart() -> None:
    """Otherwise an installed build gives other bits than the development build, or forgets them."""
    apart = re.search(r"set\(wide ([^)]*)\)", (ROOT / "cmake" / "core.cmake").read_text())
    assert apart is not None
    cloned = {
        str(path.relative_to(ROOT).as_posix())
        for path in (ROOT / "cpp").rglob("*.[ch]pp")
        if "STRETCHMAP_CLONES" in path.read_text() and path.name != "clones.hpp"
    }
    assert cloned
    assert cloned <= set(apart[1].split())
