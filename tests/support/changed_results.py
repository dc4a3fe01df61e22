"""Files of results with changes and right checksums, as a stranger may write them."""

import json
import random
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

from bayesindent.core import HEADER
from support.campaigns import past_trigger
from support.learner import fnv_1a

__all__ = ["CHANGES", "change"]

#: Values that nobody means, as JSON.
NOBODYS = (
    *(None, True, "", "x", "nan", "µ\n<b>" + 5000 * "a", [], {}, [None], [[1.0]], {"x": 1.0}),
    *(-1, 0, 1, 2**31, 2**63, 0.5, -1.5, 1e-320, 1e30, 1e308, -1e308),
)
#: The numbers among them, and others that JSON has not.
NUMBERS = (0.0, -1.0, 1e-320, 1e30, 1e308, -1e308, float("nan"), float("inf"))


def digits(content: bytes) -> str:
    """The checksum of a content as files have it."""
    return f"{fnv_1a(content):016X}"


def places_in(value: Any) -> list[tuple[Any, Any]]:
    """Each container in a document with each of its keys."""
    keys = value.keys() if isinstance(value, dict) else range(len(value))
    found = [(value, key) for key in keys]
    for key in keys:
        if isinstance(value[key], dict | list):
            found += places_in(value[key])
    return found


def changed_document(content: bytes, rng: random.Random) -> bytes:
    """A document of which a few entries are other ones, gone, or there twice."""
    document = json.loads(content)
    del document["checksum"]
    for _ in range(rng.choice([1, 1, 1, 3])):
        # Top entries as often as those deep within.
        found = places_in(document)
        if rng.random() < 0.3:
            found = [(document, key) for key in document]
        if not found:
            break
        inside, key = rng.choice(found)
        kind = rng.randrange(4)
        if kind == 0:
            del inside[key]
        elif kind == 1 and isinstance(inside, list):
            inside += inside[-1:]
        elif kind == 1:
            inside[f"{key}x"] = inside.pop(key)
        else:
            inside[key] = rng.choice(NOBODYS)
    text = json.dumps(document, indent=1)
    body = text[: -len("\n}")].encode() if document else b"{"
    return body + f',\n "checksum": "text:{digits(body)}"\n}}\n'.encode()


def changed_lines(content: bytes, rng: random.Random) -> bytes:
    """A surrogate of which a few lines or numbers are other ones."""
    lines = content.decode().splitlines()[:-1]
    for _ in range(rng.choice([1, 1, 1, 3])):
        # The first lines name what the surrogate is; the others have its numbers.
        at = rng.randrange(rng.choice([min(60, len(lines)), len(lines)]))
        words = lines[at].split(" ")
        kind, word = rng.randrange(6), rng.randrange(len(words))
        if kind == 0:
            del lines[at]
        elif kind == 1:
            lines.insert(at, lines[at])
        elif kind == 2:
            lines[at] += " 1"
        else:
            values = [*map(str, NUMBERS), "-1", "3", "99999999999", "x", "cubic", "", "0"]
            words[word] = rng.choice(values)
            lines[at] = " ".join(words)
    body = ("\n".join(lines) + "\n").encode()
    return body + f"checksum {digits(body)}\n".encode()


def changed_values(content: bytes, rng: random.Random) -> bytes:
    """A posterior of which a few values have other headers, names or contents."""
    body, at, values = content[:-16], 0, []
    while at < len(body):
        kind, rank, length, size, *shape = HEADER.unpack_from(body, at)
        start = at + HEADER.size + length + -length % 8
        name = body[at + HEADER.size : at + HEADER.size + length]
        values.append([kind, rank, name, shape, body[start : start + size], length, size])
        at = start + size + -size % 8
    for _ in range(rng.choice([1, 1, 1, 3])):
        value = rng.choice(values)
        what = rng.randrange(9)
        if what == 0:
            value[0] = rng.choice([b"t", b"l", b"i", b"b", b"r", b"x"])
        elif what == 1:
            value[1] = rng.choice([0, 1, 2, 3, 4, 255])
        elif what == 2:
            value[2] = rng.choice([b"", b"x", b"\xff" * 8, value[2][::-1]])
            value[5] = len(value[2])
        elif what == 3:
            value[3][rng.randrange(4)] = rng.choice([-1, 0, 1, 2, 10**6, 2**40, 2**63 - 1])
        elif what == 4:
            value[3][:2] = value[3][1::-1]
        elif what == 5:
            value[rng.choice([5, 6])] = rng.choice([-8, 0, 8, 2**31 - 1])
        elif what == 6 and value[0] == b"r" and value[4]:
            place = 8 * rng.randrange(len(value[4]) // 8)
            number = struct.pack("<d", rng.choice(NUMBERS))
            value[4] = value[4][:place] + number + value[4][place + 8 :]
        elif what == 7:
            values.remove(value) if rng.random() < 0.5 else values.append(value)
        else:
            place = rng.randrange(len(value[4]) + 1)
            value[4] = value[4][:place] + rng.randbytes(8) + value[4][place + 8 :]
            value[6] = len(value[4])
    body = b"".join(
        HEADER.pack(kind, rank, length, size, *shape)
        + name
        + bytes(-len(name) % 8)
        + part
        + bytes(-len(part) % 8)
        for kind, rank, name, shape, part, length, size in values
    )
    return body + digits(body).encode()


def changed_campaign(content: bytes, rng: random.Random, path: Path) -> bytes:
    """A campaign of which a row has other values, and the checksum of them."""
    path.write_bytes(content)
    texts = [
        "symmetry",
        "constants",
        "euler_deg",
        "origin",
        "status",
        "message",
        "depth_um",
        "force_mn",
    ]
    numbers = ["indentation_modulus_gpa", "elements", "seconds"]
    with closing(sqlite3.connect(path)) as file:
        # Values that the layout forbids.
        file.execute("PRAGMA ignore_check_constraints = 1")
        ids = [row[0] for row in file.execute("SELECT id FROM simulation")]
        row = rng.choice(ids)
        for _ in range(rng.choice([1, 1, 2])):
            column = rng.choice([*texts, *numbers, "position", "physics_id"])
            value: Any = rng.choice(
                [
                    *("", "[]", "[1.0]", "[1.0, nan, 1e999]", "[", "cubic", "triclinic", "done"),
                    *("failed", "a\x00b", "µ\n", 5000 * "a", "[" + 40000 * "1, " + "1]"),
                    *(b"\xff\x00", -1, 0, 2, 2**31, 2**63 - 1, 1e308, -1e308, 1e-320),
                ]
            )
            statement = (
                f"UPDATE OR IGNORE simulation SET {column} = {literal(value)} WHERE id = {row}"
            )
            past_trigger(file, "simulation_is_not_changed", statement)
        identity, *found = file.execute(
            f"SELECT identity, {', '.join(texts + numbers)} FROM simulation LEFT JOIN physics "
            f"ON physics.id = physics_id WHERE simulation.id = {row}"
        ).fetchone()
        checksum = row_checksum(identity or "", found)
        statement = f"UPDATE simulation SET checksum = '{checksum}' WHERE id = {row}"
        past_trigger(file, "simulation_is_not_changed", statement)
    return path.read_bytes()


def literal(value: Any) -> str:
    """A value in SQL."""
    if isinstance(value, bytes):
        return f"X'{value.hex()}'"
    return f"CAST(X'{value.encode().hex()}' AS TEXT)" if isinstance(value, str) else repr(value)


def row_checksum(identity: str, values: list) -> str:
    """The checksum of a row of a campaign, see fortran/campaign/campaign.f90."""
    *texts, modulus, elements, seconds = values
    numbers = [number if isinstance(number, int | float) else 0 for number in (modulus, seconds)]
    bits = [struct.unpack("<q", struct.pack("<d", number))[0] for number in numbers]
    whole = max(0, elements) if isinstance(elements, int) else 0
    parts = [identity, *(as_bytes(text) for text in texts), bits[0], whole, max(0, bits[1])]
    return digits(b"\n".join(map(as_bytes, parts)))


def as_bytes(value: Any) -> bytes:
    """What the core reads of a cell."""
    if isinstance(value, bytes):
        return value
    return b"" if value is None else str(value).encode()


#: How the content of a file is changed, by the end of its name.
CHANGES: dict[str, Callable] = {
    ".json": changed_document,
    ".txt": changed_lines,
    ".bin": changed_values,
    ".sqlite": changed_campaign,
}


def change(path: Path, content: bytes, rng: random.Random) -> None:
    """Write a changed content of a file."""
    more = (path,) if path.suffix == ".sqlite" else ()
    path.write_bytes(CHANGES[path.suffix](content, rng, *more))
