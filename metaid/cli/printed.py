"""A study in the terminal, as `metaid study show` prints it and `metaid study run` at its end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from metaid.cli.common import print_table, say, say_reasons
from metaid.episode import MEASURES
from metaid.errors import first_of
from metaid.frames import NO_ERROR, number_text
from metaid.results import MODEL_ERRORS, RESULTS, describe_possible_bodies, estimate_texts, shown_rows, summary

PLUS_MINUS = "±"  # half the interval
COLUMNS = ("nominal", "identified", PLUS_MINUS, "true")
FAULT_COLUMNS = ("identified", PLUS_MINUS, "true")
PARAMETER_COLUMNS = ("nominal", "identified", "sd", "low", "high", "true")
DISPENSABLE = ("nominal", "sd", "true", "error")  # columns of lumps that are left out where the terminal is too narrow
DIGITS, MOST_DIGITS = 5, 8
MOST_NAMED = 10  # trials of others
NUMBERED = "numbered as Optuna numbers them"
SHORT = 1e-6  # of a unit: what is less is written with an exponent
SMALL = 5e-6  # as a share: below this a percentage with three digits behind the point says nothing


def print_study(store: Any, name: str, with_bodies: bool = False) -> dict[str, Any]:
    """Every lump beside its nominal value, and the truth where the plant knows it; what was tried, and the best; what
    that says of each link, where this is to be said; last of all the verdict. Returns the summary that this is of.
    """
    shown = summary(store, name, with_bodies)
    title = f"{shown['name']}: {shown['plant']}, {shown['sampler']}, {shown['measure']}, seed {shown['seed']}"
    rows, note = [[lump["name"], *lump_cells(lump)] for lump in shown_rows(shown)], "; ".join(describe_tried(shown))
    print_table(title, ["lump", *COLUMNS, "error", "unit"], rows, note, ["unit"], DISPENSABLE)
    if faults := shown_rows(shown, "faults"):
        _print_faults(faults)
    _say_foreign(shown.get("foreign_trials", []), MEASURES[shown["measure"]].unit)
    if shown["trials"]["total"] or shown["estimate"]:
        say(_origin(shown))
    if with_bodies:
        _show_bodies(shown)
    say_reasons(shown["verdict"].upper(), _reasons(shown))
    return shown


def describe_tried(shown: dict[str, Any]) -> list[str]:
    """What was tried, and the best of it."""
    trials, best, unit = shown["trials"], shown["best"], MEASURES[shown["measure"]].unit
    failed = f", {trials['failed']} failed" if trials["failed"] else ""
    parts = [f"{trials['total']} trials, {trials['pruned']} of them falls{failed}"]
    if shown["periods"]:
        parts.append(f"{shown['periods']} period{'s' * (shown['periods'] != 1)} counted in the others")
    if best["value"] is None:
        return [*parts, "no survivor yet"]
    parts.append(f"best {best['value']:.3g} {unit} at trial {best['number']}")
    if best["value"] < 0.0:
        parts[-1] += " (below zero: the noise of a plant at rest is subtracted, and noise was luckily small)"
    if "noise_floor_hz" in shown:
        parts.append(f"noise floor {shown['noise_floor_hz']:.3g} Hz, subtracted")
    return parts


def _origin(shown: dict[str, Any]) -> str:
    """What the lumps are of, and what the estimate from all trials says beside them."""
    if shown["estimate"] is None:
        return f"no estimate from all trials: {shown['why_no_estimate']}"
    texts = estimate_texts(shown)
    half = texts["interval"] and f"{PLUS_MINUS} is half the {texts['interval']}"
    said = f"estimate from {texts['of']}", texts["known"], half, shown["estimate"]["description"]
    return "; ".join(filter(None, said))


def _reasons(shown: dict[str, Any]) -> list[str]:
    """The reasons of the verdict in a `summary`, of a result with how well the lumps are known and the largest error
    where it is known; of what is approximate how well it predicts before all.
    """
    reasons = list(shown["reasons"])
    if shown["verdict"] not in RESULTS:
        return reasons
    known = [lump for lump in shown["lumps"] if lump["determined"]]
    first = reasons[: shown["verdict"] == "approximate"]
    if "expression" in known[0]:
        said = [f"{len(known)} base parameters", *_model_error(shown["model_error"])]
    else:
        widest = max((lump["high"] - lump["low"]) / (2.0 * lump["identified"]) for lump in known)
        said = [f"{len(known)} lumps, each to within {error_text(widest, '')} or better"]
        if shown["max_error"] is not None:
            said[0] += f", largest error {error_text(shown['max_error'], '')}"
    said += _fault_texts(shown.get("faults", []))
    return [*first, *said, *reasons[len(first) :]]


def _fault_texts(faults: list[dict[str, Any]]) -> list[str]:
    """The faults that were found beside the lumps, with half their intervals, in one part of a sentence."""
    known = [fault for fault in faults if fault["determined"]]
    texts = [f"{each['name']} {each['identified']:.4g} ± {_half(each):.2g} {each['unit']}" for each in known]
    return [", ".join(texts)] if texts else []


def _half(row: dict[str, Any]) -> float | None:
    """Half the interval of a lump or of a fault."""
    return None if row["low"] is None else (row["high"] - row["low"]) / 2.0


def _half_text(half: float | None) -> str:
    """Two digits of half an interval, by a decimal point where that is not too long."""
    if half is None or not SHORT <= half < 1.0:
        return number_text(half, ".2g")
    return f"{half:.{1 - math.floor(math.log10(half))}f}"


def _model_error(errors: dict[str, float] | None) -> list[str]:
    """How wrong an arm's dynamics are on states that no trial has seen, where the truth is known."""
    if errors is None:
        return []
    said = ", ".join(f"{name} {error_text(errors[key], '')}" for key, name in MODEL_ERRORS.items())
    return [f"on states that no trial has seen wrong by: {said}"]


def _say_foreign(trials: list[dict[str, Any]], unit: str) -> None:
    """Which trials of the study metaid did not write: those that its objective evaluated, and all others."""
    evaluated = [trial for trial in trials if "value" in trial]
    if evaluated:
        survivors = [trial for trial in evaluated if trial["state"] == "COMPLETE" and trial["value"] is not None]
        best = min(survivors, key=lambda trial: trial["value"], default=None)
        found = "none survived" if best is None else f"best {best['value']:.3g} {unit} at trial {best['number']}"
        say(f"{len(evaluated)} trials of others, evaluated by metaid.objective: {found} ({NUMBERED})")
    left = [trial for trial in trials if "value" not in trial]
    if left:
        named = first_of([f"{trial['number']} {trial['state']}" for trial in left], MOST_NAMED)
        say(f"not metaid's trials, left alone and not counted here: {named} ({NUMBERED})")


def _print_faults(faults: list[dict[str, Any]]) -> None:
    rows = [
        [row["name"], *_cells(row, FAULT_COLUMNS), number_text(row["error"], "+.2g"), row["unit"]] for row in faults
    ]
    print_table("Faults searched beside the lumps", ["fault", *FAULT_COLUMNS, "error", "unit"], rows, words=["unit"])


def lump_cells(lump: dict[str, Any]) -> list[str]:
    """The numbers of a lump by COLUMNS, its error and unit."""
    return [*_cells(lump, COLUMNS), error_text(lump["error"]), lump["unit"]]


def _cells(lump: dict[str, Any], columns: Sequence[str]) -> list[str]:
    """The numbers of a lump or of a fault by `columns`; in the place of an identified value that there is not, that it
    was not found.
    """
    digits = _digits(lump)
    cells = {
        key: _half_text(_half(lump))
        if key == PLUS_MINUS
        else number_text(lump[key], f".{DIGITS if key == 'nominal' else digits}g")
        for key in columns
    }
    if lump["identified"] is None:
        cells["identified"] = "not found"
    return list(cells.values())


def _digits(lump: dict[str, Any]) -> int:
    """How many a lump's numbers need to show how wide its interval is; DIGITS where a few more would not show it."""
    if lump["low"] is None or not lump["low"] < lump["high"] or not lump["identified"]:
        return DIGITS
    half = (lump["high"] - lump["low"]) / (2.0 * abs(lump["identified"]))
    digits = math.ceil(-math.log10(half)) + 1
    return digits if DIGITS <= digits <= MOST_DIGITS else DIGITS


def error_text(error: float | None, sign: str = "+") -> str:
    """A relative error in percent; none where it is what rounding left."""
    if error is not None and abs(error) < NO_ERROR:
        return "0%"
    if error is not None and abs(error) < SMALL:
        return f"{100.0 * error:{sign}.1g}%"
    return number_text(error, f"{sign}.3%")


def _show_bodies(shown: dict[str, Any]) -> None:
    if shown["bodies"] is None:
        say(shown["why_no_bodies"])
        return
    rows, keys = [], [key for key in PARAMETER_COLUMNS if key in shown["bodies"][0]]
    for row in shown_rows(shown, "bodies"):
        cells = {key: number_text(row[key]) for key in keys}
        if not row["bounded"]:
            cells["high"] = "unbounded"
        rows.append([row["name"], *cells.values(), row["unit"]])
    title = "Possible bodies with these base parameters" if "sd" in keys else "All possible bodies with these lumps"
    print_table(title, ["parameter", *keys, "unit"], rows, words=["unit"], dispensable=DISPENSABLE)
    say(describe_possible_bodies(shown["bodies"]))
