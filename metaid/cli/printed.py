"""A study in the terminal, as `metaid study show` prints it and `metaid study run` at its end."""

from __future__ import annotations

from typing import Any

from metaid.cli.common import number_text, print_table, say

COLUMNS = ("nominal", "identified", "low", "high", "true")
PARAMETER_COLUMNS = ("nominal", "low", "high", "true")
MOST_NAMED = 10  # trials of others
SMALL = 5e-6  # as a share: below this a percentage with three digits behind the point says nothing


def print_study(store: Any, name: str) -> None:
    """Every lump beside its nominal value, and the truth where the plant knows it; what was tried, and the best; the
    estimate from all trials, where the study does not stand by it already.
    """
    from metaid.episode import MEASURES
    from metaid.results import summary

    shown = summary(store, name)
    trials, best = shown["trials"], shown["best"]
    by_estimate = shown["source"] == "estimate"
    title = f"{shown['name']}: {shown['plant']}, {shown['sampler']}, {shown['measure']}, seed {shown['seed']}"
    unit = MEASURES[shown["measure"]].unit
    found = ["no survivor yet"]
    if best["value"] is not None:
        found = [f"best {best['value']:.3g} {unit} at trial {best['number']}"]
    if not by_estimate and best["value"] is not None:
        found += _largest_error(shown)
    if "noise_floor_hz" in shown:
        found.append(f"noise floor {shown['noise_floor_hz']:.3g} Hz, subtracted")
    if "mujoco" in best:
        found.append(_verification(best["mujoco"]))
    for stage in shown.get("stages", [])[1:]:
        if stage["best"]["value"] is not None:
            found.append(f"stage 2: best {stage['best']['value']:.3g} {unit} at trial {stage['best']['number']}")
    failed = f", {trials['failed']} failed" if trials["failed"] else ""
    note = "; ".join([f"{trials['total']} trials, {trials['pruned']} of them falls{failed}", *found])
    _print_lumps(title, shown["lumps"], note)
    _say_foreign(shown.get("foreign_trials", []))
    if "parameters" in shown:
        _show_parameters(shown)
    if by_estimate:
        _show_own_estimate(shown)
        return
    if missed := _not_determined(shown["lumps"]):
        say(f"not identified: {missed}: {shown['measure']} with these pushes cannot determine them")
    if trials["total"]:
        _show_estimate(shown)


def _say_foreign(trials: list[dict[str, Any]]) -> None:
    """Which trials of the study metaid did not write."""
    if not trials:
        return
    named = ", ".join(f"{trial['number']} {trial['state']}" for trial in trials[:MOST_NAMED])
    more = f" and {len(trials) - MOST_NAMED} more" if len(trials) > MOST_NAMED else ""
    say(f"not metaid's trials, left alone and not counted here: {named}{more} (numbered as Optuna numbers them)")


def _print_lumps(title: str, lumps: list[dict[str, Any]], note: str) -> None:
    rows = [
        [lump["name"], *(number_text(lump[key]) for key in COLUMNS), _error_text(lump["error"]), lump["unit"]]
        for lump in lumps
    ]
    print_table(title, ["lump", *COLUMNS, "error", "unit"], rows, note, words=["unit"])


def _show_own_estimate(shown: dict[str, Any]) -> None:
    """What the lumps of a study that stands by its estimate are worth, below their table."""
    from metaid.results import describe_trials

    if not shown["trials"]["total"]:
        return
    estimate = shown["estimate"]
    if estimate is None:
        say(f"no estimate: {shown['why_no_estimate']}")
        return
    say(f"estimate from {describe_trials(estimate, shown['trials']['total'])}: {_worth(estimate)}")
    _say_missed(estimate)


def _show_estimate(shown: dict[str, Any]) -> None:
    """The estimate from all trials of a study that stands by its best one."""
    from metaid.results import describe_known_from, describe_misfit, describe_trials

    estimate = shown["estimate"]
    if estimate is None:
        say(f"no estimate from all trials: {shown['why_no_estimate']}")
        return
    title = f"Estimate from {describe_trials(estimate, shown['trials']['total'])}"
    if not estimate["explains"]:
        say(f"{title}: {describe_misfit(estimate)}")
        return
    _print_lumps(
        title, estimate["lumps"], f"{_worth(estimate)}; {describe_known_from(estimate, shown['trials']['total'])}"
    )
    _say_missed(estimate)


def _worth(estimate: dict[str, Any]) -> str:
    """What the misfit, the intervals and, where it is known, the truth say of an estimate."""
    from metaid.results import describe_misfit

    if not estimate["explains"]:
        return describe_misfit(estimate)
    return "; ".join([describe_misfit(estimate), "low to high is the 95 % interval", *_largest_error(estimate)])


def _say_missed(estimate: dict[str, Any]) -> None:
    if estimate["explains"] and (missed := _not_determined(estimate["lumps"])):
        say(f"not identified: {missed}: these trials do not determine them")


def _not_determined(lumps: list[dict[str, Any]]) -> str:
    return ", ".join(lump["name"] for lump in lumps if not lump["determined"])


def _largest_error(shown: dict[str, Any]) -> list[str]:
    largest = shown["max_error"]
    return [] if largest is None else [f"largest error {_error_text(largest, '')}"]


def _error_text(error: float | None, sign: str = "+") -> str:
    """A relative error in percent."""
    if error is not None and 0.0 < abs(error) < SMALL:
        return f"{100.0 * error:{sign}.0e}%"
    return number_text(error, f"{sign}.3%")


def _show_parameters(shown: dict[str, Any]) -> None:
    from metaid.results import describe_bodies

    rows = [
        [row["name"], *(number_text(row[key]) for key in PARAMETER_COLUMNS), row["unit"]] for row in shown["parameters"]
    ]
    print_table("Bodies that move the same", ["parameter", *PARAMETER_COLUMNS, "unit"], rows, words=["unit"])
    say(describe_bodies(shown))


def _verification(mujoco: dict[str, Any]) -> str:
    outcome = "it falls in MuJoCo" if mujoco["fell"] else f"MuJoCo gives {mujoco['value']:.3g}"
    return f"found with analytic physics, {outcome}: {'verified' if mujoco['agrees'] else 'NOT VERIFIED'}"
