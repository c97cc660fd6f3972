"""Bad input of every kind that a user, an accident or a stranger may hand in: files, arguments, factors, DBs.

Pure functions of a `random.Random`, so that a case can be made again from its seed.
"""

from __future__ import annotations

import copy
import math
import re
import sqlite3
import tomllib
from pathlib import Path
from random import Random
from typing import Any

import tomli_w

NUMBERS: tuple[float | int, ...] = (
    *(math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, -5e-324, 1e-308, 1e-300, 1e-12, 1e-6, 1e-3, 0.5, 1.0, 1.4),
    *(2.0, 10.0, 1e3, 1e6, 1e9, 1e155, 1e300, -1e300, 1.7976931348623157e308, 0, 1, -1, 2, 3, 7, 64, 65, 1000, 1001),
    *(2**31, 2**32 - 1, 2**32, 2**53 + 1, 2**63 - 1, 2**63, 2**64, -(2**63), -(2**63) - 1, 10**40, 10**400),
)
TEXTS = (
    *("", " ", "three-link", "one-link.toml", "../plant.toml", "../../../etc/passwd", "/etc/passwd", "/dev/zero", "."),
    *("..", "~", "~root/x.toml", "file:///etc/passwd", "C:\\x.toml", "\\\\host\\share.toml", "a/b.toml", "con.toml"),
    *("x" * 300, "x" * 300 + ".toml", "x" * 5000, "nan", "inf", "1e999", "-0", "0x10", "1_0", "٣", "ＮａＮ", "None"),
    *("<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "{{ 7 * 7 }}", "{text}", "%s%n", "$x$ \\frac{"),
    *("=1+1", "@SUM(A1)", "'; DROP TABLE studies; --", "$(touch owned)", "`touch owned`", "a;b", "a\nb", "a\r\nb"),
    *("\x1b[2J\x1b]0;title\x07", "\x9b31m", "\x7f", "\u202egnp.exe", "\u200b", "\ufeff", "\U0001f4a5", "a\tb", "é"),
    *("cmaes", "tpe", "random", "output-error", "dinoip", "optuna-cmaes", "spectral", "count", "crossing", "maxima"),
    *("complete", "alternations", "rich", "designed", "tip", "plain", "nominal-metric", "mujoco"),
)
TOKENS = (
    *(b"nan", b"inf", b"-inf", b"+nan", b"-0.0", b"1e999", b"-1e999", b"1e-999", b"5e-324", b"1e300", b"9" * 5000),
    *(b"0x" + b"f" * 5000, b"0b1", b"1_0.0_1", b"1979-05-27", b"07:32:00", b"1979-05-27T07:32:00Z", b"true", b"''"),
    *(b'"""', b"'''", b"[" * 50 + b"]" * 50, b"[" * 3000, b"{a=" * 60 + b"1" + b"}" * 60, b"a." * 500 + b"a = 1"),
    *(b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\x1b[2J", b"\xed\xa0\x80", b"\xc3", b"\r", b"\n", b"=", b"[[links]]\n"),
    *(b"[links]\n", b"[search]\n", b"[episode]\n", b"#", b'"', b"\\", b'"\\ud800"', b'"\\u0000"', b"links = 3\n"),
)
_ATTRIBUTE = re.compile(rb'\b(\w+)="([^"]*)"')
_NUMERAL = re.compile(rb"-?\b\d+(?:\.\d+)?\b")
_WORD = re.compile(rb"\b[a-z_]+\b")


def number(random: Random) -> float | int:
    """A number on the edge of something, or any."""
    kind = random.random()
    if kind < 0.8:
        return random.choice(NUMBERS)
    return random.uniform(-2.0, 3.0) if kind < 0.9 else 10.0 ** random.uniform(-320, 308)


def value(random: Random, depth: int = 0) -> Any:
    """Anything that a TOML file can hold."""
    kind = random.random()
    if kind < 0.55 or depth > 3:
        return number(random)
    if kind < 0.75:
        return random.choice(TEXTS)
    if kind < 0.8:
        return random.random() < 0.5
    if kind < 0.9:
        return [value(random, depth + 1) for _ in range(random.choice((0, 1, 1, 2, 3, 9)))]
    if kind < 0.98:
        return {random.choice(TEXTS)[:400]: value(random, depth + 1) for _ in range(random.choice((0, 1, 2)))}
    return nested(random.choice((20, 200)))


def nested(depth: int) -> Any:
    """A list in a list in a list …"""
    inner: Any = 1
    for _ in range(depth):
        inner = [inner]
    return inner


def toml(random: Random, sources: list[bytes]) -> bytes:
    """A file like one of `sources`, spoiled: in its values, in its text, or both; now and then pure noise."""
    text = random.choice(sources)
    kind = random.random()
    if kind < 0.02:
        return random.randbytes(random.choice((0, 1, 16, 300)))
    if kind < 0.65:
        text = _with_other_values(random, text)
    if kind > 0.55:
        text = _with_other_text(random, text, sources)
    return text


def xml(random: Random, sources: list[bytes]) -> bytes:
    """A file like one of `sources`, with other attributes, now and then with other text."""
    text = random.choice(sources)
    for _ in range(random.choice((0, 1, 1, 1, 2, 4))):
        given = random.choice(list(_ATTRIBUTE.finditer(text)))
        words = given[2].split()
        if words and random.random() < 0.7:
            words[random.randrange(len(words))] = str(number(random)).encode()
        else:
            words = [random.choice(TEXTS).encode()] if random.random() < 0.5 else words[1:]
        attribute = given[1] + b'="' + b" ".join(words) + b'"'
        text = text[: given.start()] + (attribute if random.random() < 0.9 else b"") + text[given.end() :]
    return _with_other_text(random, text, sources) if random.random() < 0.2 else text


def _with_other_values(random: Random, text: bytes) -> bytes:
    tables = tomllib.loads(text.decode())
    for _ in range(random.choice((1, 1, 1, 2, 3, 6))):
        _change_one(random, tables)
    try:
        return tomli_w.dumps(tables).encode()
    except (UnicodeEncodeError, RecursionError, ValueError):
        return text


def _change_one(random: Random, tables: dict[str, Any]) -> None:
    """Replaces, takes out, adds or doubles one entry somewhere."""
    here: Any = tables
    while True:
        keys = list(here) if isinstance(here, dict) else list(range(len(here)))
        if not keys:
            return
        key = random.choice(keys)
        deeper = isinstance(here[key], dict | list) and here[key]
        if not deeper or random.random() < 0.15:
            break
        here = here[key]
    kind = random.random()
    if kind < 0.7:
        here[key] = value(random)
    elif kind < 0.8:
        del here[key]
    elif isinstance(here, dict):
        here[random.choice((*KEYS, *TEXTS[:40]))] = value(random)
    else:
        here.append(copy.deepcopy(here[key]))


KEYS = (
    *("description", "gravity", "timestep", "truth_known", "over_compensation", "links", "length", "mass", "com"),
    *("inertia", "damping", "stiffness", "plant", "nominal", "sampler", "trials", "seed", "workers", "search"),
    *("episode", "coordinates", "start", "low", "high", "sigma", "generation", "target", "increment"),
    *("coarse_to_fine", "measure", "rule", "pushes", "count", "peak_speed", "steps", "fall_limit"),
    *("fall_margin", "__class__", "model_config", "model_fields", "name"),
)


def _with_other_text(random: Random, text: bytes, sources: list[bytes]) -> bytes:
    for _ in range(random.choice((1, 1, 2, 4))):
        kind, at = random.randrange(8), random.randrange(len(text) + 1)
        if kind == 0 and text:
            flipped = bytes((text[at - 1] ^ (1 << random.randrange(8)),))
            text = text[: at - 1] + flipped + text[at:] if at else text
        elif kind == 1:
            text = text[:at] + random.choice(TOKENS) + text[at:]
        elif kind == 2:
            text = text[:at]
        elif kind == 3:
            other = random.choice(sources)
            text = text[:at] + other[random.randrange(len(other)) :]
        elif kind == 4:
            text = _replace_one(random, _WORD, text, random.choice(KEYS).encode())
        elif kind == 5:
            lines = text.splitlines(keepends=True)
            random.shuffle(lines)
            text = b"".join(lines)
        else:
            text = _replace_one(random, _NUMERAL, text, random.choice(TOKENS))
    return text


def _replace_one(random: Random, what: re.Pattern[bytes], text: bytes, new: bytes) -> bytes:
    places = list(what.finditer(text))
    if not places:
        return text
    place = random.choice(places)
    return text[: place.start()] + new + text[place.end() :]


def factors(random: Random, nlump: int) -> Any:
    """What may be handed in as a vector of `nlump` factors: mostly numbers, some of them no factors."""
    kind = random.random()
    if kind < 0.6:
        return [number(random) if random.random() < 0.4 else random.uniform(0.5, 1.5) for _ in range(nlump)]
    if kind < 0.8:
        return [random.uniform(0.9, 1.6) for _ in range(nlump)]
    if kind < 0.9:
        return [1.0] * random.choice((0, 1, nlump - 1, nlump + 1, 100))
    return random.choice((None, "1.0", ["a"] * nlump, [None] * nlump, [1j] * nlump, [[1.0] * nlump], 1.0, {}, b"1"))


def spoil_bytes(random: Random, path: Path) -> None:
    """Damage to a file as disks and transfers do it: bytes changed, a block of zeros, an end that is missing."""
    whole = bytearray(path.read_bytes())
    kind = random.random()
    if kind < 0.2:
        whole = whole[: random.choice((0, 1, 16, 100, 512, random.randrange(len(whole))))]
    elif kind < 0.35:
        at = random.randrange(len(whole))
        whole[at : at + 4096] = bytes(min(4096, len(whole) - at))
    else:
        for _ in range(random.choice((1, 2, 5, 50))):
            at = random.randrange(100) if random.random() < 0.3 else random.randrange(len(whole))
            whole[at] = random.randrange(256)
    path.write_bytes(whole)


def spoil_rows(random: Random, path: Path) -> None:
    """Rows of a DB as no program wrote them: other values, other types, rows gone or twice, settings changed."""
    connection = sqlite3.connect(path)
    tables = [name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
    try:
        for _ in range(random.choice((1, 1, 1, 2, 5))):
            table = random.choice([name for name in tables if not name.startswith("sqlite_")])
            columns = [row[1] for row in connection.execute(f'PRAGMA table_info("{table}")')]
            ids = [row[0] for row in connection.execute(f'SELECT rowid FROM "{table}"')]
            if ids:
                _spoil_row(random, connection, table, random.choice(columns), random.choice(ids))
        connection.commit()
    finally:
        connection.close()


def _spoil_row(random: Random, connection: sqlite3.Connection, table: str, column: str, row: int) -> None:
    where = f'"{table}" WHERE rowid = {row}'
    kind = random.random()
    if kind < 0.1:
        connection.execute(f"DELETE FROM {where}")
        return
    (old,) = connection.execute(f'SELECT "{column}" FROM {where}').fetchone()
    new: Any = random.choice((None, *TEXTS, *NUMBERS, b"\x80\x04.", b"\xff", "[" * 2000, "{}", "null", "NaN", "1e999"))
    if isinstance(old, str) and old and kind < 0.6:  # changed a little: most often the study's settings, as JSON
        new = _with_other_text(random, old.encode(), [old.encode()]).decode(errors="replace")
    if isinstance(new, int) and not -(2**63) <= new < 2**63:
        new = str(new)
    try:
        connection.execute(f'UPDATE "{table}" SET "{column}" = ? WHERE rowid = {row}', (new,))
    except (sqlite3.IntegrityError, UnicodeEncodeError):
        return  # what the DB itself does not let in
