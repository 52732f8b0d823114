"""Damage done to the bytes of a file: bits, blocks, numbers, counts, encodings."""

from __future__ import annotations

import io
import random
import re
import zipfile
from collections.abc import Callable

Mutation = Callable[[random.Random, bytes], bytes]

_NUMBER = re.compile(rb"(?<![\w.#])[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?(?![\w.])")
_WHOLE = re.compile(rb"(?<![\w.+-])\d+(?![\w.])")
_HEADER = 600  # bytes in which the counts of most formats stand
_NUMBERS = [
    b"nan", b"inf", b"-inf", b"1e400", b"-1", b"0", b"-0", b"1e308", b"2147483648", b"-2147483649",
    b"4294967297", b"18446744073709551616", b"9" * 400, b"0x10", b"1_0", b"1,5", b"1.5.2", b"1d3",
    b"", b"3.0", b"1e9", b"999999999", b"\xd9\xa3",
]  # fmt: skip
_INSERTED = [
    b"\n" * 200, b" " * 500, b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"# a comment\n", b"\r", b"\\\n",
    b"(" * 300, b"<!-- ", b"]]>", b"&x;", b"end_header\n", b"\x1a", b"A" * 70_000,
]  # fmt: skip


def _place(rng: random.Random, data: bytes) -> int:
    """A place in the file, every second time in its header."""
    return rng.randrange(min(len(data), _HEADER) if rng.random() < 0.5 else len(data))


def _flip(rng: random.Random, data: bytes) -> bytes:
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8))):
        out[_place(rng, data)] ^= 1 << rng.randrange(8)
    return bytes(out)


def _overwrite(rng: random.Random, data: bytes) -> bytes:
    at, size = _place(rng, data), rng.choice((1, 2, 4, 8, 16))
    filler = rng.choice((b"\0", b"\xff", b"\x7f", b" ", None))
    part = rng.randbytes(size) if filler is None else filler * size
    return data[:at] + part + data[at + size :]


def _cut_off(rng: random.Random, data: bytes) -> bytes:
    return data[: _place(rng, data)]


def _block(rng: random.Random, data: bytes) -> tuple[int, int]:
    lines = [0, *(m.end() for m in re.finditer(b"\n", data))]
    if rng.random() < 0.6 and len(lines) > 3:  # whole lines
        first = rng.randrange(len(lines) - 1)
        return lines[first], lines[min(len(lines) - 1, first + rng.choice((1, 1, 2, 10)))]
    at = _place(rng, data)
    return at, min(len(data), at + rng.choice((1, 3, 4, 8, 24, 100)))


def _delete(rng: random.Random, data: bytes) -> bytes:
    start, end = _block(rng, data)
    return data[:start] + data[end:]


def _repeat(rng: random.Random, data: bytes) -> bytes:
    start, end = _block(rng, data)
    return data[:end] + data[start:end] * rng.choice((1, 1, 3, 50)) + data[end:]


def _exchange(rng: random.Random, data: bytes) -> bytes:
    (a, b), (c, d) = sorted((_block(rng, data), _block(rng, data)))
    if b > c:
        return _flip(rng, data)
    return data[:a] + data[c:d] + data[b:c] + data[a:b] + data[d:]


def _insert(rng: random.Random, data: bytes) -> bytes:
    at = _place(rng, data)
    return data[:at] + rng.choice(_INSERTED) + data[at:]


def _number(rng: random.Random, data: bytes) -> bytes:
    found = list(_NUMBER.finditer(data, 0, _HEADER if rng.random() < 0.5 else len(data)))
    if not found:
        return _flip(rng, data)
    chosen = rng.sample(found, min(len(found), rng.choice((1, 1, 3))))
    for at in sorted(chosen, key=lambda match: -match.start()):
        data = data[: at.start()] + rng.choice(_NUMBERS) + data[at.end() :]
    return data


def _count(rng: random.Random, data: bytes) -> bytes:
    """A whole number of the header becomes one more, one less, another of them, or huge."""
    found = list(_WHOLE.finditer(data, 0, _HEADER))
    if not found:
        return _flip(rng, data)
    at, other = rng.choice(found), rng.choice(found)
    value = int(at[0])
    new = rng.choice((value + 1, value - 1, 0, 2 * value, 10**9, int(other[0])))
    return data[: at.start()] + b"%d" % new + data[at.end() :]


def _word(rng: random.Random, data: bytes) -> bytes:
    """A word of the header becomes another one of it."""
    found = list(re.finditer(rb"[A-Za-z_]\w*", data[:_HEADER]))
    if not found:
        return _flip(rng, data)
    at, other = rng.choice(found), rng.choice(found)
    return data[: at.start()] + other[0] + data[at.end() :]


def _encode(rng: random.Random, data: bytes) -> bytes:
    """The whole file in another encoding, or with its bytes the other way round."""
    text = data.decode("latin-1")
    at = rng.choice((0, 80, 84, data.find(b"\n") + 1))
    turned = b"".join(data[k : k + 4][::-1] for k in range(at, len(data), 4))
    return rng.choice((
        text.encode("utf-16"), b"\xef\xbb\xbf" + data, data.replace(b"\n", b"\r\n"),
        data.replace(b"\n", b"\r"), data.replace(b"\n", b"\n\n"), data.upper(), data.lower(),
        data.replace(b" ", b"\t"), data.replace(b".", b","), data[:at] + turned,
        data.replace(b"little", b"big"), data.replace(b"LittleEndian", b"BigEndian"),
        data.replace(b"float32", b"float64").replace(b"<f8", b">f8"), data + data,
    ))  # fmt: skip


MUTATIONS: list[Mutation] = [
    _flip, _overwrite, _cut_off, _delete, _repeat, _exchange, _insert, _number, _count, _word,
    _encode,
]  # fmt: skip


def mutant(data: bytes, seed: str) -> bytes:
    """The file with one to three pieces of damage, always the same for the same seed."""
    rng = random.Random(seed)
    if data[:2] == b"PK" and rng.random() < 0.85:  # else checksums alone would refuse it
        return _inside_archive(rng, data)
    return _damaged(rng, data)


def _damaged(rng: random.Random, data: bytes) -> bytes:
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        if data:
            data = rng.choice(MUTATIONS)(rng, data)
    return data


def _inside_archive(rng: random.Random, data: bytes) -> bytes:
    """A sound archive with a damaged member, one left out, one twice or one renamed."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name, other = rng.choice(sorted(members)), rng.choice(sorted(members))
    kind = rng.random()
    if kind < 0.7:
        members[name] = _damaged(rng, members[name])
    elif kind < 0.8:
        del members[name]
    elif kind < 0.9:
        members[name] = members[other]
    else:
        members[rng.choice((name + "x", "a/" + name, "F.npy", "T.npy", ".npy"))] = members.pop(name)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for key, content in members.items():
            archive.writestr(key, content)
    return out.getvalue()
