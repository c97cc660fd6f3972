"""How well lumps are found on plants with faults: the error of each against each fault's size, beside least squares.

    python -m benchmarks.robustness             # 2, 3 and 5 links, five chains each; nine minutes of computing
    python -m benchmarks.robustness --quick     # two links, two chains, two sizes
    python -m benchmarks.robustness -o docs/images    # writes robustness.png and robustness-lumps.png as well

Chains and their wrong nominal models are those of benchmarks/chains.py. metaid runs studies with measure = "smoothed"
and sees what the sensors read after pushes. Least squares knows the torques as well: it gets what the same sensors
read along exciting trajectories (benchmarks/recording.py) under the same faults, torques as the drives' limits let
them through, derivatives by Savitzky-Golay with the span that is best in hindsight. Its feedback always has speeds to
see, its regression takes them from the angles; where the drives are too weak for its trajectories, it gets smaller
ones. One fault at a time; those of angles come without a speed sensor for metaid.
"led": the study is told by how much torques come late (`lead`); least squares is not.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.common import Row, table
from benchmarks.faulted import FAULTS, LINKS, NO_FAULT, SEEDS, Result, identify, jobs
from metaid.show.figures import COLOURS, INK, PAGE, save, style

WANTED = 0.01  # worst error of a lump
LEAST = "torque limit"  # the fault that is the worse the less it is


def worst(results: list[Result], kind: str, method: str = "errors") -> float:
    """The median over chains of the worst lump of a `kind`, "gravity", "coriolis" or "" for both."""
    return float(
        median(
            max(
                error
                for name, error in zip(result.names, getattr(result, method), strict=True)
                if name.startswith(kind)
            )
            for result in results
        )
    )


def curve(
    results: list[Result], links: int, fault: str, kind: str, method: str = "errors"
) -> list[tuple[float, float]]:
    """Sizes of a fault and the median worst error at each."""
    own = [result for result in results if (result.links, result.fault) == (links, fault)]
    sizes = sorted({result.size for result in own}, reverse=fault == LEAST)
    return [(size, worst([result for result in own if result.size == size], kind, method)) for size in sizes]


def largest_size(points: list[tuple[float, float]], wanted: float = WANTED) -> float | None:
    """The size up to which the error is at most `wanted`, on straight lines between the logarithms; None if it is more
    at the smallest that was tried, infinite if it never is."""
    if points[0][1] > wanted:
        return None
    for (size, error), (larger, more) in itertools.pairwise(points):
        if more > wanted:
            share = np.log(wanted / error) / np.log(more / error)
            return float(size * (larger / size) ** share)
    return np.inf


def error_rows(results: list[Result]) -> list[Row]:
    """Median worst errors, in percent, for every fault and size."""
    links = sorted({result.links for result in results})
    rows: list[Row] = []
    for fault, size in dict.fromkeys((result.fault, result.size) for result in results):
        row: Row = {"fault": fault if fault == NO_FAULT else f"{fault}, {FAULTS[fault].unit}", "size": size or None}
        for nlink in links:
            own = [r for r in results if (r.links, r.fault, r.size) == (nlink, fault, size)]
            for kind in ("gravity", "coriolis"):
                row[f"N = {nlink}, {kind}, %"] = 100.0 * worst(own, kind)
            row[f"N = {nlink}, least squares, %"] = 100.0 * worst(own, "", "least_squares")
        rows.append(row)
    return rows


def first_rows(results: list[Result]) -> list[Row]:
    """For each fault, the size up to which 1 % is kept, and the lump that is lost first."""
    rows = []
    for fault in FAULTS:
        for nlink in sorted({result.links for result in results}):
            own = [result for result in results if (result.links, result.fault) == (nlink, fault)]
            row: Row = {"fault": f"{fault}, {FAULTS[fault].unit}", "links": nlink}
            for kind in ("gravity", "coriolis"):
                row[f"{kind} within 1 % up to"] = _shown(curve(results, nlink, fault, kind), fault)
            row["least squares, up to"] = _shown(curve(results, nlink, fault, "", "least_squares"), fault)
            row["first lump beyond"] = _first(own, fault)
            rows.append(row)
    return rows


def _shown(points: list[tuple[float, float]], fault: str) -> str:
    size, least = largest_size(points), fault == LEAST
    if size is None:
        return f"{'over' if least else 'under'} {points[0][0]:g}"
    return f"{points[-1][0]:g} and {'less' if least else 'more'}" if np.isinf(size) else f"{size:.2g}"


def _first(own: list[Result], fault: str) -> str:
    """The lump whose median error passes 1 % at the smallest size; of several, the one whose is largest."""
    for size in sorted({result.size for result in own}, reverse=fault == LEAST):
        middle = np.median([result.errors for result in own if result.size == size], axis=0)
        if middle.max() > WANTED:
            return f"{own[0].names[int(middle.argmax())]}, {middle.max():.1%} at {size:g}"
    return "none"


def draw_pictures(results: list[Result], folder: Path) -> None:
    """`robustness.png`, all faults and numbers of links; `robustness-lumps.png`, each lump of three links."""
    links = sorted({result.links for result in results})
    with style():
        figure, axes = _panels(7.0)
        for fault, each in zip(FAULTS, axes, strict=True):
            for colour, nlink in zip(COLOURS, links, strict=False):
                for kind, line in (("gravity", "-"), ("coriolis", "--")):
                    each.plot(*zip(*curve(results, nlink, fault, kind), strict=True), line, color=colour)
                known = curve(results, nlink, fault, "", "least_squares")
                each.plot(*zip(*known, strict=True), ":", color=colour, marker=".", markersize=3)
        for colour, nlink in zip(COLOURS, links, strict=False):
            axes[0].plot([], [], color=colour, label=f"{nlink} links")
        for line, label in (("-", "gravity"), ("--", "Coriolis"), (":", "least squares")):
            axes[0].plot([], [], line, color=INK, label=label)
        _finish(figure, folder / "robustness.png")
        nlink = 3 if 3 in links else links[-1]
        figure, axes = _panels(6.0)
        for fault, each in zip(FAULTS, axes, strict=True):
            own = [result for result in results if (result.links, result.fault) == (nlink, fault)]
            sizes = sorted({result.size for result in own})
            middle = np.array([np.median([r.errors for r in own if r.size == size], axis=0) for size in sizes])
            for colour, name, errors in zip(COLOURS, own[0].names, middle.T, strict=False):
                each.plot(sizes, errors, color=colour, label=name)
        _finish(figure, folder / "robustness-lumps.png")


def _panels(height: float) -> tuple[Figure, list[Any]]:
    """A figure of that `height`, in inches, with a panel for every fault."""
    figure = Figure(figsize=(PAGE, height), layout="constrained")
    axes = figure.subplots(4, 3, sharey=True).ravel().tolist()
    for (name, fault), each in zip(FAULTS.items(), axes, strict=False):
        each.set(xscale="log", yscale="log", ylim=(1e-4, 1.0), xlabel=f"{name}, {fault.unit}")
        each.set_xticks(fault.sizes, [f"{size:g}" for size in fault.sizes])
        each.minorticks_off()
        each.axhline(WANTED, color=INK, linewidth=0.6, linestyle=":")
        each.grid(True)
        if name == LEAST:
            each.invert_xaxis()
    for each in axes[::3]:
        each.set_ylabel("error")
    axes.pop().set_axis_off()
    return figure, axes


def _finish(figure: Figure, path: Path) -> None:
    """Writes a figure in few colours, with the legend in the panel that no fault has."""
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.axes[-1].legend(handles, labels, loc="center", ncols=2)
    save(figure, path)
    Image.open(path).convert("RGB").quantize(32, dither=Image.Dither.NONE).save(path, optimize=True)


def main() -> None:
    """Measures on all cores, prints two tables or JSON, and draws if it is told where."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--quick", action="store_true", help="two links, two chains, two sizes: to see that it works")
    options.add_argument("--json", action="store_true", help="every single result, as JSON")
    options.add_argument("--workers", type=int, default=2, help="processes")
    options.add_argument("-o", dest="output", type=Path, help="a folder for the pictures")
    given = options.parse_args()
    wanted = list(jobs((2,), 2, 2) if given.quick else jobs(LINKS, SEEDS))
    begun, results = time.perf_counter(), []
    with ProcessPoolExecutor(given.workers) as pool:
        for result in pool.map(identify, wanted, chunksize=5):
            results.append(result)
            print(f"\r{len(results)}/{len(wanted)}", end="", file=sys.stderr, flush=True)
    print(f"\r{len(results)} studies in {time.perf_counter() - begun:.0f} s", file=sys.stderr)
    if given.output is not None:
        draw_pictures(results, given.output)
    if given.json:
        print(json.dumps([asdict(result) for result in results]))
        return
    note = (
        "Medians over the chains; gravity and coriolis: metaid's worst lump of the kind; least squares: its worst lump."
    )
    print(f"{note}\n\n{table(error_rows(results))}\n\n{table(first_rows(results))}")


if __name__ == "__main__":
    main()
