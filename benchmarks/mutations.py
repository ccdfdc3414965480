"""Real files, damaged in the ways that editors, spreadsheets, networks and people damage files."""

from __future__ import annotations

import gzip
import random
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

__all__ = ["mutations"]

ROOT = Path(__file__).parents[1]
# So many bytes of a file are used; whole lines of it.
MOST = 60_000
CELLS = (
    b"nan inf -inf 1e999 1,5 =1+1 @x #REF! N/A null 0x10 1_000 -- +-1 1e 1e5e5 -90 180.0001 "
    b"91 -0.0 1e-320 9999999999999999999 \xef\xbc\x91 \xd9\xa1 \xff \x00 \xed\xa0\x80 ' \" "
    b"<b> ${x} ../.. true"
).split(b" ")


def _files() -> list[tuple[str, bytes]]:
    folders = [ROOT.parent / "shared" / "data", ROOT / "samples"]
    folder = next(f for f in folders if f.is_dir())
    found = []
    for path in sorted(folder.glob("*.csv*")):
        data = path.read_bytes()
        if path.suffix == ".gz":
            data = gzip.decompress(data)
        found.append((path.name, data[: data.rfind(b"\n", 0, MOST) + 1]))
    return found


def _flip(data: bytes, chance: random.Random) -> bytes:
    letters = bytearray(data)
    for _ in range(chance.choice((1, 3, 30))):
        letters[chance.randrange(len(letters))] = chance.randrange(256)
    return bytes(letters)


def _cut(data: bytes, chance: random.Random) -> bytes:
    return data[: chance.randrange(len(data))]


def _hole(data: bytes, chance: random.Random) -> bytes:
    start = chance.randrange(len(data))
    return data[:start] + data[start + chance.randrange(1, 2000) :]


def _repeat(data: bytes, chance: random.Random) -> bytes:
    start = chance.randrange(len(data))
    piece = data[start : start + chance.randrange(1, 3000)]
    return data[:start] + piece * chance.randrange(2, 5) + data[start:]


def _lines(data: bytes, chance: random.Random) -> bytes:
    lines = data.splitlines(keepends=True)
    for _ in range(chance.choice((1, 5))):
        k = chance.randrange(len(lines))
        match chance.randrange(4):
            case 0 if len(lines) > 1:
                del lines[k]
            case 1:
                lines.insert(k, lines[chance.randrange(len(lines))])
            case 2:
                chance.shuffle(lines)
            case _:
                lines[k] = lines[k].rstrip(b"\r\n") + chance.choice(
                    (b",\n", b",1\n", b";\n", b"\r")
                )
    return b"".join(lines)


def _cell(data: bytes, chance: random.Random) -> bytes:
    lines = data.split(b"\n")
    for _ in range(chance.choice((1, 1, 10))):
        k = chance.randrange(len(lines))
        cells = lines[k].split(b",")
        cells[chance.randrange(len(cells))] = chance.choice(CELLS)
        lines[k] = b",".join(cells)
    return b"\n".join(lines)


def _header(data: bytes, chance: random.Random) -> bytes:
    lines = data.split(b"\n")
    k = next((k for k, line in enumerate(lines) if line[:1].isalpha()), 0)
    names = lines[k].split(b",")
    match chance.randrange(5):
        case 0:
            chance.shuffle(names)
        case 1:
            names[chance.randrange(len(names))] = chance.choice(names)
        case 2:
            names[chance.randrange(len(names))] = chance.choice(CELLS)
        case 3:
            names.pop()
        case _:
            names = [name.upper() for name in names]
    lines[k] = b",".join(names)
    return b"\n".join(lines)


def _column(data: bytes, chance: random.Random) -> bytes:
    factor, column = chance.choice((0.0, -1.0, 1e300, 1e-300, 57.29578)), chance.randrange(6)
    lines = []
    for line in data.split(b"\n"):
        cells = line.split(b",")
        if column < len(cells):
            with suppress(ValueError):  # a header or a comment
                cells[column] = repr(float(cells[column]) * factor).encode()
        lines.append(b",".join(cells))
    return b"\n".join(lines)


def _encoding(data: bytes, chance: random.Random) -> bytes:
    text = data.decode("utf-8", "replace")
    return chance.choice(
        (
            text.encode("utf-16"),
            text.encode("utf-32"),
            b"\xef\xbb\xbf" + data,
            data.replace(b"\n", b"\r\n"),
            data.replace(b"\n", b"\r"),
            data.replace(b",", b";").replace(b".", b","),
            data.replace(b",", b"\t"),
            data.replace(b",", b" "),
            data.replace(b".", b","),
            data.replace(b"\n", b"\n\n"),
            b'"' + data.replace(b",", b'","') + b'"',
        )
    )


def _packed(data: bytes, chance: random.Random) -> bytes:
    packed = gzip.compress(data, 1)
    return chance.choice((lambda d, c: d, _flip, _cut, _hole, _repeat))(packed, chance)


KINDS: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    *(_flip, _cut, _hole, _repeat, _lines, _cell, _cell, _header, _column, _encoding, _packed),
)


def mutations(cases: int, seed: int) -> Iterator[tuple[str, bytes]]:
    """Give so many damaged files, each with what was done to which.

    Parameters
    ----------
    cases : int
        How many.
    seed : int
        Of the choices.
    """
    files = _files()
    chance = random.Random(seed)
    for k in range(cases):
        name, data = files[k % len(files)]
        done = []
        for _ in range(chance.choice((1, 1, 2, 3))):
            if not data:
                break
            kind = chance.choice(KINDS)
            data = kind(data, chance)
            done.append(kind.__name__.lstrip("_"))
        yield f"{k} {name} {'+'.join(done)}", data
