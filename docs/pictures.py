"""Makes docs/images anew from shipped logs and studies, and says which pictures are stale.

    .venv/bin/python docs/pictures.py           # all but those of benchmarks; films need EGL or OSMesa, pages chromium
    .venv/bin/python docs/pictures.py log       # some: log, terminal, figures, paper, films, pages
    .venv/bin/python docs/pictures.py --check   # makes them elsewhere, and says which differ; status 1 if one does

docs/images/said.json has what each picture says: its texts; of a film the command, and the lumps that it is of; of the
dashboard the note; of the paper what the command prints. A picture is stale where its command says something else now,
numbers within rounding, or where
more than DISTANCE of its pixels differ. The pictures of benchmarks name their command in their document.
"""

from __future__ import annotations

import argparse
import base64
import html
import io
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from PIL import Image
from rich.console import Console, Group
from rich.text import Text

ROOT = Path(__file__).parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from browser import Browser, open_browser  # noqa: E402

import metaid as api  # noqa: E402
from metaid.cli.live import Live  # noqa: E402
from metaid.plant import load_plant  # noqa: E402
from metaid.results import read_findings  # noqa: E402
from metaid.show import make_dashboard  # noqa: E402
from metaid.show.figures import COLOURS, INK, Gallery, laid_out, plant_figure, save, style  # noqa: E402
from metaid.show.notes import note  # noqa: E402
from metaid.store import Store  # noqa: E402
from metaid.study import Progress, run_study  # noqa: E402
from soak.notebooks import same  # noqa: E402

IMAGES = ROOT / "docs" / "images"
SAID = IMAGES / "said.json"
OF_BENCHMARKS = ("peers.png", "samplers.png", "scaling.png")
DISTANCE = 0.02  # share of the pixels that differ by more than a quarter of black to white
VARYING = ("live.svg",)  # with a rate and a time that are left: words alone are compared

# Three links from far away, so that some candidates fall; and two links, counted, for the boundary of falling.
FROM_AFAR = "three-link-coast --name from-afar --set search.coordinates=plain --set search.start=1.4 --set trials=800"
BOUNDARY = (
    "two-link-tpe --name boundary --set sampler=random --set search.coordinates=plain"
    " --set episode.measure=crossing --set search.low=0.6 --set search.high=1.6"
)
FIGURES = {"from-afar": ("convergence", "factors", "frequency"), "boundary": ("boundary",)}
FILMS = {
    "film.gif": ("noisy-three-link", "three-link", ()),
    "arm-film.gif": ("pa10", "pa10", ("--name", "sagging", "--set", "nominal.seed=22")),
}
LOG_SHOWN = 1  # of the three runs: both joints move, and the shoulder has a torque
Made = Iterator[tuple[str, str]]  # the name of a picture that was written, and what it says


def log(into: Path) -> Made:
    """The torques of a real double pendulum in one run, as the nominal model and the other two runs predict them."""
    found = api.estimate("double-pendulum", "double-pendulum")
    nominal = replace(found, estimate=replace(found.estimate, held_out=found.estimate.nominal_held_out))
    shown, believed = found.left_out[LOG_SHOWN], nominal.left_out[LOG_SHOWN]
    times = shown.times - shown.times[shown.judged][0]
    with style():
        figure = Figure(figsize=(7.0, 3.0), layout="constrained")
        figure.suptitle("A real double pendulum: motor torque in a run that was left out", fontsize=10, weight="bold")
        for joint, axes in enumerate(figure.subplots(1, 2)):
            measured = shown.measured[shown.judged, joint]
            axes.plot(times[shown.judged], measured, color=INK, label="measured")
            for part, name, colour, dashes in (
                (believed, "nominal model, its friction fitted", COLOURS[2], ":"),
                (shown, "identified from the other runs", COLOURS[1], "--"),
            ):
                predicted = part.predicted[shown.judged, joint]
                off = float(np.linalg.norm(measured - predicted) / np.linalg.norm(measured))
                label = f"{name}: {off:.0%} off"
                axes.plot(times[shown.judged], predicted, color=colour, linestyle=dashes, linewidth=1.6, label=label)
            axes.set_title(f"joint {joint + 1}")
            axes.set_xlabel("time, s")
            axes.set_ylabel("torque, N m")
            axes.grid(True)
            axes.set_ylim(top=1.75 * axes.get_ylim()[1])
            axes.legend(loc="upper left")
    yield drawn(figure, into / "log.png")


def terminal(into: Path) -> Made:
    """What `metaid study run three-link` prints, and what a terminal shows half-way through a longer run."""
    console = Console(record=True, width=92, file=io.StringIO())
    for command in ("study create three-link", "study run three-link"):
        console.print(Text(f"$ metaid {command}", style="bold green"))
        console.print(Text.from_ansi(metaid(*command.split()).rstrip()))
    yield written(console, "metaid", into / "three-link.svg")
    metaid("study", "create", *FROM_AFAR.split())
    store = Store("metaid.db")
    console = Console(record=True, width=90, file=io.StringIO(), force_terminal=True, markup=False, highlight=False)
    live = Live(store, "from-afar", False, console)
    shown = False

    def watch(progress: Progress) -> None:
        nonlocal shown
        time.sleep(0.02)  # as slow as a plant that is worth watching, for the rate and the time left
        live.update(progress)
        if progress.trials >= 500 and not shown:
            shown = True
            console.print(Group(*live._bar.get_renderables()))

    run_study(store, "from-afar", watch=watch)
    store.close()
    yield written(console, "metaid study run from-afar", into / "live.svg")


def figures(into: Path) -> Made:
    """The figures that the documents show."""
    for study, settings in (("from-afar", FROM_AFAR), ("boundary", BOUNDARY)):
        metaid("study", "create", *settings.split(), "--exist-ok")
        metaid("study", "run", study, "--quiet")
        store = Store("metaid.db")
        gallery = Gallery(read_findings(store, study))
        for name in FIGURES[study]:
            yield drawn(gallery.picture(name).figure, into / f"{name}.png")
        if study == "from-afar":
            yield drawn(plant_figure(gallery.found.problem.open_plant()), into / "plant.png")
        store.close()
    yield drawn(plant_figure(load_plant("pa10")), into / "arm.png")


def paper(into: Path) -> Made:
    """The paper's tables and figures, as the commands draw them."""
    for name in ("table1", "table2", "fig4", "sweep"):
        target = into / f"paper-{name}.png"
        printed = metaid("paper", name, "-o", str(target))
        yield target.name, " ".join(printed.replace(str(target), target.name).split())


def films(into: Path, render: bool = True) -> Made:
    """A push with the nominal, the identified and the true law; without `render` only what the films are of."""
    for name, (plant, study, settings) in FILMS.items():
        metaid("study", "create", study, *settings, "--exist-ok")
        called = settings[1] if settings else study
        metaid("study", "run", called, "--quiet")
        command = ("episode", plant, "--study", called, "--video")
        if render:
            metaid(*command, str(into / name))
        lumps = [f"{lump.name} {lump.identified:.4g}" for lump in api.lumps(called, "metaid.db").itertuples()]
        yield name, f"metaid {' '.join(command)} {name}: {', '.join(lumps)}"


def pages(into: Path) -> Made:
    """The report and the dashboard, in a browser."""
    metaid("study", "create", *FROM_AFAR.split(), "--exist-ok")
    metaid("study", "run", "from-afar", "--quiet")
    metaid("study", "report", "from-afar", "-o", "report.html")
    store = Store("metaid.db")
    with open_browser(Path("profile").resolve()) as browser:
        browser.look(Path("report.html").resolve().as_uri())
        yield "report.png", shoot(browser, into / "report.png", 1200, 1500)
        with make_dashboard(store, 0) as server:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            study = store.optuna.get_study_id_from_name("from-afar")
            browser.look(f"http://127.0.0.1:{server.server_port}/dashboard/studies/{study}")
            time.sleep(5)
            shoot(browser, into / "dashboard.png", 1200, 1900)
            server.shutdown()
    yield "dashboard.png", note(read_findings(store, "from-afar"))
    store.close()


PARTS: dict[str, Callable[[Path], Made]] = {
    "log": log,
    "terminal": terminal,
    "figures": figures,
    "paper": paper,
    "films": films,
    "pages": pages,
}


def metaid(*arguments: str) -> str:
    """What a command prints, run as a user does."""
    program = [sys.executable, "-c", "from metaid.cli import main; main()", *arguments]
    return subprocess.run(program, check=True, stdout=subprocess.PIPE, text=True).stdout


def drawn(figure: Figure, path: Path) -> tuple[str, str]:
    """A figure that is written, by few bytes, with the texts in it."""
    save(figure, path)
    shrink(path)
    buffer = io.StringIO()
    with style(), laid_out(figure, "svg"):
        figure.savefig(buffer, format="svg")
    return path.name, said_by(buffer.getvalue())


def written(console: Console, title: str, path: Path) -> tuple[str, str]:
    """What a console has recorded, as SVG that fetches no font."""
    svg = re.sub(r"@font-face \{.*?\}\s*", "", console.export_svg(title=title), flags=re.DOTALL)
    path.write_text(svg, encoding="utf-8")
    return path.name, said_by(svg)


def said_by(svg: str) -> str:
    """The texts of an SVG."""
    texts = re.findall(r"<text.*?</text>", svg, flags=re.DOTALL)
    return html.unescape(" ".join(" ".join(re.sub(r"<[^>]+>", " ", text).split()) for text in texts))


# The texts of a page that are above a height, in pixels.
ABOVE = """
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), range = document.createRange();
const said = [];
while (walker.nextNode()) {
  range.selectNodeContents(walker.currentNode);
  const r = range.getBoundingClientRect();
  if (r.height > 0 && r.bottom < arguments[0]) said.push(walker.currentNode.textContent.trim());
}
return said.filter(text => text).join(' ');
"""


def shoot(browser: Browser, path: Path, width: int, height: int) -> str:
    """A picture of the page's beginning, and what can be read there."""
    clip = {"x": 0, "y": 0, "width": width, "height": height, "scale": 1}
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    time.sleep(1)
    shot = browser.driver.execute_cdp_cmd("Page.captureScreenshot", {"captureBeyondViewport": True, "clip": clip})
    path.write_bytes(base64.b64decode(shot["data"]))
    shrink(path)
    return str(browser.driver.execute_script(ABOVE, height))


def shrink(path: Path) -> None:
    """As few bytes as a picture of few colours needs."""
    Image.open(path).convert("RGB").quantize(128, dither=Image.Dither.NONE).save(path, optimize=True)


def digest(path: Path) -> str:
    """Of the bytes of a picture."""
    return sha256(path.read_bytes()).hexdigest()[:16]


def distance(one: Path, other: Path) -> float:
    """The share of pixels that differ by more than a quarter of black to white; 1 where the sizes differ."""
    first, second = (np.asarray(Image.open(path).convert("L"), dtype=float) for path in (one, other))
    return 1.0 if first.shape != second.shape else float((np.abs(first - second) > 64.0).mean())


def stale(name: str, said: str, made: Path | None, record: dict[str, Any]) -> str | None:
    """Why a stored picture is stale, given what it says now, and the picture of now where there is one."""
    if name not in record:
        return "is not in said.json"
    stored = record[name]["said"]
    if name in VARYING:
        stored, said = (re.sub(r"[^\W\d]*[\d:.,]+", "#", text) for text in (stored, said))
    if not same(stored, said):
        return f"says now: {said}\n  and stored is: {stored}"
    if made is not None and made.suffix == ".png" and (far := distance(IMAGES / name, made)) > DISTANCE:
        return f"looks otherwise: {far:.1%} of its pixels differ, {DISTANCE:.0%} are allowed"
    return None


def main() -> None:
    """Makes or checks what the command line asks for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)} (default: all)")
    parser.add_argument("--check", action="store_true", help="make them elsewhere, and say which differ")
    given = parser.parse_args()
    if unknown := set(given.parts) - set(PARTS):
        parser.error(f"unknown part '{min(unknown)}' (allowed: {', '.join(PARTS)})")
    record, wrong = json.loads(SAID.read_text(encoding="utf-8")) if SAID.exists() else {}, 0
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        into = Path(folder, "made") if given.check else IMAGES
        into.mkdir(exist_ok=True)
        for part in given.parts or PARTS:
            for name, said in PARTS[part](into):
                if not given.check:
                    record[name] = {"sha256": digest(IMAGES / name), "said": said}
                    continue
                why = stale(name, said, into / name, record)
                wrong += why is not None
                print(f"{name}: {why or 'as stored'}", flush=True)
        os.chdir(ROOT)
    if not given.check:
        record |= {name: {"sha256": digest(IMAGES / name)} for name in OF_BENCHMARKS}
        SAID.write_text(json.dumps(record, indent=1, ensure_ascii=False, sort_keys=True) + "\n", encoding="utf-8")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
