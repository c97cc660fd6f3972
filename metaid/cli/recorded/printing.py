"""What `metaid estimate` prints: a screen that begins with the verdict."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from metaid.cli.common import print_table, say, say_reasons
from metaid.frames import number_text

if TYPE_CHECKING:
    from metaid.recorded import RecordedResult

FEW = 12  # parameters that a screen has
AS_COLUMNS = 2  # logs to validate; more have a table of their own
NAMED = 3  # logs that a line names
REASONS = 5  # sentences: what is predicted, and four on what is not explained


def print_result(result: RecordedResult, has_numbers: bool, whole: bool) -> None:
    """Prints the verdict and the error of what was left out, joint by joint, then, where the result `has_numbers` to
    show, parameters and the curve of friction, and what is not explained; of the `whole` all numbers, and what was
    tried.
    """
    shown = result.summary
    _print_repairs(shown["logs"], whole)
    _print_held_out(shown, result)
    if has_numbers:
        _print_parameters(shown, whole)
        _print_friction(shown, result)
        if shown["gains"] is not None:
            _print_gains(shown["gains"])
        if whole:
            _print_tried(shown)
    reasons = shown["reasons"] if whole or not has_numbers else shown["reasons"][:REASONS]
    say_reasons(shown["verdict"].upper(), reasons)
    if result.estimate.equations.zeros and whole:
        for log in shown["logs"]:
            say(f"zeros of {log['path']}, added to its angles: " + ", ".join(f"{zero:+.4f}" for zero in log["zeros"]))


def _print_repairs(logs: list[dict[str, Any]], whole: bool) -> None:
    """What is true of several logs is said once; of what is counted in many logs the largest count, or the `whole`."""
    of: dict[str, list[str]] = {}
    counts: dict[str, dict[str, int]] = {}
    for log in logs:
        for repair in log["repairs"]:
            text = repair["text"]
            of.setdefault(text, []).append(log["path"])
            is_counted = text[0].isdigit() and not whole
            counts.setdefault(repair["kind"] if is_counted else text, {})[text] = repair["count"]
    for alike in counts.values():
        every = {path for text in alike for path in of[text]}
        is_many = len(every) > NAMED
        for text in [max(alike, key=lambda each: alike[each])] if is_many else alike:
            paths = of[text]
            named = ", ".join(paths) if len(paths) <= NAMED else f"{paths[0]} and {len(paths) - 1} more logs"
            fewer = len(every - {*paths}) if is_many else 0
            more = f"; fewer in {fewer} more log{'s' * (fewer > 1)}: --all" if fewer else ""
            say(f"{'all logs' if len(paths) == len(logs) > 1 else named}: {text}{more}")


def _print_held_out(shown: dict[str, Any], result: RecordedResult) -> None:
    held, nominal = shown["held_out"], shown["nominal_held_out"]
    motion = held["motion"]
    seconds = motion["seconds"]
    beside = shown["validation"] if len(shown["validation"]) <= AS_COLUMNS else []
    rows = []
    for i, (joint, before) in enumerate(zip(held["torque"]["joints"], nominal["torque"]["joints"], strict=True)):
        cells = [
            joint["name"],
            f"{joint['relative']:.1%}" if joint["of"] else "not used",
            f"{joint['rms']:.3g}",
            f"{joint['of']:.3g}",
            f"{before['relative']:.1%}" if joint["of"] else "",
            f"{1e3 * motion['angle'][i]:.3g}" if motion["angle"][i] is not None else "",
            f"{1e3 * motion['constant_speed'][i]:.3g}" if motion["constant_speed"][i] is not None else "",
        ]
        others = [each["torque"]["joints"][i] for each in beside]
        rows.append(cells + [f"{each['relative']:.1%}" if each["of"] else "" for each in others])
    torque, angle = ("N m, N", "mrad, mm") if result.estimate.model.slides.any() else ("N m", "mrad")
    columns = ["joint", "error", torque, "of", "nominal", f"{angle} {seconds:g} s", "still going"]
    columns += [each["path"] for each in beside]
    logs, window, read, doubt = shown["logs"], shown["window"], shown["friction"], result.estimate.equations.doubt
    note = (
        f"{len(logs)} log{'s' if len(logs) > 1 else ''}, {sum(log['rows'] for log in logs)} rows in "
        f"{sum(log['seconds'] for log in logs):.4g} s, of which {window['moving_s']:.4g} s move; windows of "
        f"{window['seconds']:g} s; torques below {window['cutoff_hz']:g} Hz; "
        f"friction: {', '.join(read['terms']) or 'none'}"
        + (f"; torques {1e3 * shown['delay']:.3g} ms late" if shown["delay"] else "")
        + (f"; the prior of the bodies {doubt:g} times as wide" if doubt > 1.0 else "")
    )
    title = f"{f'{len(logs)} logs' if len(logs) > 1 else shown['name']}: {shown['plant']}, what was left out"
    print_table(title, columns, rows, note, dispensable=["still going", "of", "nominal"])
    if len(shown["validation"]) > AS_COLUMNS:
        _print_validation(shown["validation"])


def _print_validation(logs: list[dict[str, Any]]) -> None:
    rows = []
    for each in logs:
        torque = each["torque"]
        worst = max(torque["joints"], key=lambda joint: joint["relative"] if joint["of"] else -1.0)
        rows.append([each["path"], f"{torque['relative']:.1%}", worst["name"], f"{worst['relative']:.1%}"])
    print_table("logs that nothing was fitted to", ["log", "error", "worst joint", "its error"], rows)


def _print_parameters(shown: dict[str, Any], whole: bool) -> None:
    friction = ("damping", "coulomb", "root", "offset", "load", "spring")
    every = shown["parameters"]
    bodies = [each for each in every if not each["name"].startswith(friction)]
    known = [each for each in bodies if each["determined"]] or bodies
    rows = [
        [
            each["name"],
            number_text(each["nominal"], ".4g"),
            f"{each['value']:.5g}",
            f"± {each['sd']:.2g}",
            f"± {each['sd_systematic']:.2g}",
            each["unit"],
        ]
        for each in (every if whole else known[:FEW])
    ]
    left = len(every) - len(rows)
    print_table(
        "bodies" if not whole else "parameters",
        ["parameter", "nominal", "value", "sd", "systematic", "unit"],
        rows,
        f"{left} more parameters: --all" if left else "",
        words=["unit"],
    )


def _print_friction(shown: dict[str, Any], result: RecordedResult) -> None:
    rows = []
    for curve in shown["friction"]["curve"]:
        cells = [
            f"{torque:.3g} ± {sd:.1g} at {speed:.2g}"
            for speed, torque, sd in zip(curve["speed"], curve["torque"], curve["sd"], strict=True)
        ]
        rows.append([curve["joint"], *cells])
    units = "N m at rad/s; N at m/s" if result.estimate.model.slides.any() else "N m at rad/s"
    print_table("friction", ["joint", "slow", "middle", f"fast ({units})"], rows)


def _print_gains(gains: list[dict[str, Any]]) -> None:
    rows = [
        [
            each["joint"],
            f"{each['gain']:.4g}",
            f"± {each['sd']:.2g}",
            f"{number_text(each['low'], '.4g')} to {number_text(each['high'], '.4g')}",
            "" if each["determined"] else "not told",
        ]
        for each in gains
    ]
    note = "The logged torques were multiplied by these: all numbers are in N m (N) and kg."
    print_table("gains of the drives", ["joint", "gain", "sd", "95 %", "payload"], rows, note)


def _print_tried(shown: dict[str, Any]) -> None:
    rows = [[each["what"], f"{each['error']:.3f}"] for each in shown["friction"]["taken_up"]]
    print_table("tried", ["what", "times the error"], rows, "taken up below 0.97, or where a joint has so much less")
