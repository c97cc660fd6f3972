"""Arguments of the command line, well and badly chosen, for every command; none that would take long if right."""

from __future__ import annotations

from random import Random

from soak.cases import NUMBERS, TEXTS

PLANTS = ("one-link", "two-link", "paper-like-two-link")
SOURCES = ("one-link-count", "three-link-coast", "two-link-tpe", "paper-two-link", "five-link")
KEYS = (
    "trials",
    "seed",
    "sampler",
    "search.low",
    "search.start.gravity_1",
    "episode.measure",
    "episode.pushes",
    "plant",
)
LUMPS = ("gravity_1", "gravity_2", "coriolis_1_2", "gravity_0", "inertia_1")
FEW = ("0", "-1", "1", "2", "50", "٥", "1e2", "1.5", "0x10", str(10**12), str(10**30), "nan", "")


def text(random: Random) -> str:
    """An argument that somebody typed, pasted or was given; with no zero byte, which the system lets nobody pass."""
    kind = random.random()
    if kind < 0.6:
        chosen = random.choice(TEXTS)
    elif kind < 0.8:
        chosen = str(random.choice([n for n in NUMBERS if not isinstance(n, int) or abs(n) < 10**50]))
    elif kind < 0.9:
        chosen = "".join(chr(random.choice((random.randrange(1, 256), random.randrange(1, 0x3000)))) for _ in range(9))
    else:  # bytes that are no text come to Python as lone surrogates
        chosen = random.randbytes(6).replace(b"\0", b"-").decode(errors="surrogateescape")
    return chosen[:2000]


def arguments(random: Random, studies: tuple[str, ...], storage: str) -> list[str]:
    """A command line; `studies` are in the DB at `storage`."""
    made = random.choice(COMMANDS)(random, studies, storage)
    kind = random.random()
    if kind < 0.1 and made:
        made[random.randrange(len(made))] = text(random)
    elif kind < 0.15:
        made.insert(random.randrange(len(made) + 1), random.choice((text(random), "--help", "--", "-", "--json", "-o")))
    elif kind < 0.2 and len(made) > 2:
        del made[random.randrange(len(made))]
    return [word for word in made if not _takes_long(word)]


def _takes_long(word: str) -> bool:
    """A word that makes a server, a viewer or a cluster of a slip in a command."""
    return word in ("view", "dashboard", "ray")


def _some(random: Random, choices: tuple[str, ...]) -> str:
    return random.choice(choices) if random.random() < 0.7 else text(random)


def _storage(random: Random, storage: str) -> list[str]:
    kind = random.random()
    if kind < 0.85:
        return ["--storage", storage]
    schemes = ("sqlite:///", "sqlite://", "postgresql://127.0.0.1:1/x", "mysql://x/y", "redis://x", "://", "nosuch://x")
    return ["--storage", random.choice((text(random), f"{random.choice(schemes)}{text(random)[:50]}", "nowhere/x.db"))]


def _plant(random: Random, _studies: tuple[str, ...], _storage: str) -> list[str]:
    return random.choice(
        (
            ["plant", "show", _some(random, PLANTS), *random.choice(([], ["--json"]))],
            ["plant", "draw", _some(random, PLANTS), "-o", f"no/{text(random)}"],
            ["plant", "draw", text(random), "-o", "plant.png"],
            ["plant", text(random)],
            ["plant", "list", text(random)],
        )
    )


def _episode(random: Random, studies: tuple[str, ...], storage: str) -> list[str]:
    made = ["episode", _some(random, PLANTS), "--steps", random.choice(FEW)]
    for _ in range(random.choice((0, 1, 1, 2))):
        factor = str(random.choice(NUMBERS[:30])) if random.random() < 0.7 else text(random)
        made += ["--factor", f"{_some(random, LUMPS)}={factor}" if random.random() < 0.9 else text(random)]
    made += random.choice(([], ["--json"], ["-o", f"{text(random)}.bmp"], ["--study", _some(random, studies)]))
    return made


def _create(random: Random, _studies: tuple[str, ...], storage: str) -> list[str]:
    made = ["study", random.choice(("create", "check")), _some(random, SOURCES)]
    for _ in range(random.choice((0, 1, 1, 2))):
        made += ["--set", f"{_some(random, KEYS)}={text(random)}" if random.random() < 0.9 else text(random)]
    if made[1] == "create":
        made += [*_storage(random, storage), *random.choice(([], ["--exist-ok"], ["--name", text(random)]))]
    return made


def _run(random: Random, studies: tuple[str, ...], storage: str) -> list[str]:
    made = ["study", "run", _some(random, studies), *_storage(random, storage)]
    made += ["--trials", random.choice(("0", "-1", "1", "8", "x", "nan", ""))]
    made += random.choice(([], ["--workers", random.choice(("0", "-1", "1", "1025", "x"))], ["--engine", text(random)]))
    return made + random.choice(([], ["--quiet"], ["--ray-address", text(random)]))


def _look(random: Random, studies: tuple[str, ...], storage: str) -> list[str]:
    name, where = _some(random, studies), _storage(random, storage)
    return random.choice(
        (
            ["study", "list", *where],
            ["study", "show", name, *where, *random.choice(([], ["--json"]))],
            ["study", "export", name, *where, "-o", random.choice(("t.csv", f"{text(random)}.csv", text(random)))],
            ["study", "plot", text(random), *where, "-o", text(random)],
            ["study", "plot", name, *where, "-o", "figures", "--over", text(random), text(random)],
            ["study", "report", text(random), *where, "-o", f"{text(random)}.html"],
            ["study", "validate", name, *where, "--pushes", random.choice(("0", "1001", "x")), "--seed", text(random)],
            ["study", "delete", text(random), *where, *random.choice(([], ["--yes"]))],
            ["study", "delete", name, *where],
            ["study", text(random), *where],
        )
    )


def _other(random: Random, _studies: tuple[str, ...], _storage: str) -> list[str]:
    return random.choice(
        ([], ["--version"], [text(random)], ["paper", text(random)], ["paper", "table1", "-o", f"x/{text(random)}"])
    )


COMMANDS = (_plant, _episode, _create, _create, _run, _look, _look, _other)
