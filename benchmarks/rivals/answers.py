"""The tables of the comparison: one a question, with who wins, and one of what each method takes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from benchmarks.common import two_digits
from benchmarks.rivals.comparing import METHODS, OURS, UNEXPLAINED, Cell
from benchmarks.rivals.conditions import CONDITIONS
from benchmarks.rivals.subjects import ARMS
from benchmarks.rivals.toolbox import TIME_IS_UP

EXACT = 1e-5  # an error below which a model is exact for any purpose: such methods are equals
WITHIN = 0.01
SHOWN_BUDGETS = (5, 60)  # s of motion, in the tables; the picture has all
WORST = 10.0  # an error that no other is worse than
MEASURES = {
    OURS: "angles after pushes",
    "mujoco.sysid, closed loop": "angles and speeds; lengths; the drives' law",
    "mujoco.sysid, open loop": "angles; lengths",
    "instrumental variables": "angles; the servo's law",
    "DIDIM": "angles; the servo's law",
    "closed-loop output error": "angles; the servo's law",
}


@dataclass(frozen=True)
class Result:
    """A `cell`, and its `error` with the filter that its method has for this condition, tuned once for all chains: the
    largest of gravity torque, Coriolis torque and mass matrix; and the error of its worst lump.
    """

    cell: Cell
    error: float
    worst_lump: float


def tuned(cells: Sequence[Cell]) -> list[Result]:
    """The results of each method with the filter whose errors are the least in the geometric mean over all cells of a
    condition, by the truth. Chains have one, and each arm.
    """
    results = []
    for kind in dict.fromkeys(_kind(cell) for cell in cells):
        own = [cell for cell in cells if _kind(cell) == kind]
        settings = max(len(cell.errors) for cell in own)
        # A cell with nothing found has one setting, and is as bad with every other.
        errors = np.array(
            [[_largest(cell.errors[min(i, len(cell.errors) - 1)]) for i in range(settings)] for cell in own]
        )
        best = int(np.argmin(np.log(np.clip(errors, EXACT, WORST)).mean(axis=0)))
        for cell, error in zip(own, errors[:, best], strict=True):
            results.append(Result(cell, float(error), cell.errors[min(best, len(cell.errors) - 1)]["worst_lump"]))
    return results


def _kind(cell: Cell) -> tuple[str, str, str]:
    return cell.condition, cell.method, ARMS.get(cell.links, "chains")


def _largest(errors: dict[str, float]) -> float:
    return max(errors[name] for name in ("gravity", "coriolis", "mass_matrix"))


def print_answers(cells: Sequence[Cell]) -> None:
    """Prints all tables as Markdown."""
    results = tuned(cells)
    for condition in CONDITIONS:
        own = [result for result in results if result.cell.condition == condition]
        if own:
            print(f"### {CONDITIONS[condition].title}\n\n{question(own)}\n")
    print(f"### Who is ahead of metaid\n\n{ahead(results)}\n\n{summary(results)}\n")
    print(f"### What each takes\n\n{costs(results)}\n\n{time_of_parts(cells)}")


def question(results: Sequence[Result]) -> str:
    """Medians over the chains of the largest error, a row a method, a column for each length and time."""
    columns = sorted({(each.cell.links, each.cell.budget) for each in results})
    columns = [column for column in columns if column[1] in SHOWN_BUDGETS] or columns
    head = ["method", *(f"{name_of(links)}, {budget} s" for links, budget in columns), "within 1 %"]
    middle = {column: medians(results, column) for column in columns}
    stands = {column: counted(results, column) for column in columns}
    rows = []
    for method in METHODS:
        own = [each for each in results if each.cell.method == method]
        if own:
            shown = [_figure(middle[column], stands[column], method, _says(own, column)) for column in columns]
            good = sum(each.error <= WITHIN for each in own)
            rows.append([method, *shown, f"{good} of {len(own)}"])
    rows.append(["best of the others ÷ metaid output-error", *(_lead(middle[column]) for column in columns), ""])
    return _table(head, rows)


def name_of(links: int) -> str:
    """Of a chain of so many links, or of the arm with so many joints."""
    return ARMS.get(links, f"N = {links}")


def _lead(middle: dict[str, float]) -> str:
    """How many times larger than ours the least error of the others is; nothing where one is exact, or ours missing."""
    others = [error for method, error in middle.items() if method != OURS]
    if OURS not in middle or not others or min(others) <= EXACT:
        return "–"
    return two_digits(min(others) / max(middle[OURS], EXACT))


def medians(results: Sequence[Result], column: tuple[int, int]) -> dict[str, float]:
    """The median error of each method on chains of so many links in so many seconds: on the chains that ours was run on
    too, where there are any.
    """
    own = [each for each in results if (each.cell.links, each.cell.budget) == column]
    ours = {each.cell.seed for each in own if each.cell.method == OURS}
    middle = {}
    for method in dict.fromkeys(each.cell.method for each in own):
        errors = {each.cell.seed: each.error for each in own if each.cell.method == method}
        shared = [error for seed, error in errors.items() if seed in ours]
        middle[method] = median(shared or errors.values())
    return middle


def counted(results: Sequence[Result], column: tuple[int, int]) -> dict[str, float]:
    """The same of the methods that stand by all of these results: one that says "not found" does not win."""
    own = [each for each in results if (each.cell.links, each.cell.budget) == column]
    refused = {each.cell.method for each in own if each.cell.verdict == "not found"}
    return {method: error for method, error in medians(results, column).items() if method not in refused}


def winners(middle: dict[str, float]) -> list[str]:
    """The methods with the least of these errors; all that are exact, where any is; none of none."""
    least = min(middle.values(), default=0.0)
    return [method for method, error in middle.items() if error <= max(least, EXACT)]


def _says(results: Sequence[Result], column: tuple[int, int]) -> str:
    """A mark where a method itself said of any of these results that it is not found, and one where it did not end."""
    said = {each.cell.verdict for each in results if (each.cell.links, each.cell.budget) == column}
    return ("†" if "not found" in said else "") + ("‡" if TIME_IS_UP in said else "")


def _figure(middle: dict[str, float], stands: dict[str, float], method: str, mark: str) -> str:
    if method not in middle:
        return "–"
    error = middle[method]
    text = ("exact" if error <= EXACT else two_digits(100.0 * error)) + mark
    return f"**{text}**" if "†" not in mark and method in winners(stands) else text


def ahead(results: Sequence[Result]) -> str:
    """Which methods have less error than ours, in how many cells, by how much, and in which conditions. Where we say
    "not found" all others that stand by their results are ahead.
    """
    head = ["method", "ahead in", "of", "by a factor of, median", "most", "where most", "conditions"]
    found: dict[str, list[tuple[float, tuple[str, int, int]]]] = {}
    beside: Counter[str] = Counter()
    for condition, *column in dict.fromkeys(
        (each.cell.condition, each.cell.links, each.cell.budget) for each in results
    ):
        where = column[0], column[1]
        own = [each for each in results if each.cell.condition == condition]
        middle, stands = medians(own, where), counted(own, where)
        if OURS in middle:
            beside.update(list(stands))
            for method in stands:
                by = max(middle[OURS], EXACT) / max(middle[method], EXACT)
                if method != OURS and (by > 1.0 or OURS not in stands):
                    found.setdefault(method, []).append((by, (condition, *where)))
    rows = []
    for method, cells in sorted(found.items(), key=lambda each: -len(each[1])):
        most, (condition, links, budget) = max(cells)
        conditions = ", ".join(f"{name} {count}" for name, count in Counter(cell[0] for _, cell in cells).most_common())
        factors = f"{median(by for by, _ in cells):.2g}", f"{most:.2g}", f"{condition}, {name_of(links)}, {budget} s"
        rows.append([method, str(len(cells)), str(beside[method]), *factors, conditions])
    return _table(head, rows)


def costs(results: Sequence[Result]) -> str:
    """Of everything: medians of what a method's experiment asks of the rig and of its computing, how wrong its worst
    lump is, how often it succeeds, and what it has to measure.
    """
    links = sorted({each.cell.links for each in results})
    head = ["method", "within 1 %", "worst lump, %", *(f"N m, {name_of(number)}" for number in links)]
    head += ["range of angles, rad", "computing, s", "most, s", "measures, beside the command"]
    rows = []
    for method in METHODS:
        every = [each for each in results if each.cell.method == method]
        own = [each for each in every if np.isfinite(each.error)]
        if own:
            success = f"{sum(each.error <= WITHIN for each in every) / len(every):.0%}"
            chains = [each for each in own if each.cell.links not in ARMS]
            lump = f"{100.0 * median(each.worst_lump for each in chains):.2g}" if chains else "–"
            cells = [each.cell for each in own]
            torques = [[cell.torque for cell in cells if cell.links == number] for number in links]
            strain = [f"{median(each):.3g}" if each else "–" for each in torques]
            taken = [f"{median(getattr(cell, name) for cell in cells):.2g}" for name in ("range", "cpu")]
            most = f"{max(cell.cpu for cell in cells):.2g}"
            rows.append([method, success, lump, *strain, *taken, most, MEASURES.get(method, "angles")])
    return _table(head, rows)


def time_of_parts(cells: Sequence[Cell]) -> str:
    """Seconds of computing of each part, and of all."""
    parts = dict.fromkeys((cell.condition for cell in cells), 0.0)
    for cell in cells:
        parts[cell.condition] += cell.cpu
    told = ", ".join(f"{name} {spent:.0f} s" for name, spent in parts.items())
    return f"Computing: {told}; together {sum(parts.values()) / 60.0:.1f} minutes of one processor."


def summary(results: Sequence[Result]) -> str:
    """In how many cells each method has the least error, or is exact: of conditions that methods know or search, of
    those that nobody knows, and of all.
    """
    sentences = []
    kinds = {
        "that methods know of or search": tuple(name for name in CONDITIONS if name not in UNEXPLAINED),
        "that nobody knows of": UNEXPLAINED,
        "of both kinds": tuple(CONDITIONS),
    }
    for kind, conditions in kinds.items():
        own = [each for each in results if each.cell.condition in conditions]
        groups = sorted({(each.cell.condition, each.cell.links, each.cell.budget) for each in own})
        groups = [group for group in groups if any(_is_in(each, group) and each.cell.method == OURS for each in own)]
        first = Counter(
            method
            for group in groups
            for method in winners(counted([each for each in own if _is_in(each, group)], group[1:]))
        )
        told = ", ".join(f"{method} {count} ({count / len(groups):.0%})" for method, count in first.most_common())
        sentences.append(f"Least error, or exact, of {len(groups)} cells of conditions {kind}: {told}.")
    return "\n\n".join(sentences)


def _is_in(result: Result, group: tuple[str, int, int]) -> bool:
    return (result.cell.condition, result.cell.links, result.cell.budget) == group


def _table(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
