"""Makes docs/images anew from a real run: the film, figures, the report, the dashboard and the live view.

.venv/bin/python docs/pictures.py        # all of them; needs chromium, and something that renders (EGL or OSMesa)
.venv/bin/python docs/pictures.py log    # what logs of the real double pendulum predict, which needs neither
"""

from __future__ import annotations

import base64
import io
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image
from rich.console import Console, Group

ROOT = Path(__file__).parent.parent
IMAGES = ROOT / "docs" / "images"
sys.path.insert(0, str(ROOT / "tests"))

from browser import Browser, open_browser  # noqa: E402

import metaid as api  # noqa: E402
from metaid.cli.live import Live  # noqa: E402
from metaid.plant import load_plant  # noqa: E402
from metaid.recorded import left_out  # noqa: E402
from metaid.results import read_findings  # noqa: E402
from metaid.show import make_dashboard  # noqa: E402
from metaid.show.figures import COLOURS, INK, Gallery, plant_figure, save, style  # noqa: E402
from metaid.store import Store  # noqa: E402
from metaid.study import Progress, run_study  # noqa: E402

# Three links from far away, so that some candidates fall; and two links, counted, for the boundary of falling.
STUDIES = (
    "three-link",
    "three-link-coast --name from-afar --set search.coordinates=plain --set search.start=1.4 --set trials=800",
    "two-link-tpe --name boundary --set sampler=random --set search.coordinates=plain"
    ' --set episode.measure="crossing" --set search.low=0.6 --set search.high=1.6',
)

LOG_SHOWN = 1  # of the three runs: both joints move, and the shoulder has a torque


def main() -> None:
    """Runs the studies in an empty folder and draws everything, or what is named."""
    IMAGES.mkdir(exist_ok=True)
    log_picture()
    if sys.argv[1:] == ["log"]:
        return
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for study in STUDIES:
            metaid("study", "create", *study.split())
        metaid("study", "run", "three-link", "--quiet")
        metaid("study", "run", "boundary", "--quiet")
        store = Store("metaid.db")
        live_view(store)
        metaid("episode", "noisy-three-link", "--study", "three-link", "--video", str(IMAGES / "film.gif"))
        metaid("study", "create", "pa10", "--name", "sagging", "--set", "nominal.seed=22")
        metaid("study", "run", "sagging", "--quiet")
        metaid("episode", "pa10", "--study", "sagging", "--video", str(IMAGES / "arm-film.gif"))
        figures(store)
        metaid("study", "report", "from-afar", "-o", "report.html")
        with open_browser(Path(folder) / "profile") as browser:
            browser.look((Path(folder) / "report.html").as_uri())
            shoot(browser, "report.png", 1200, 1500)
            dashboard(store, browser)
        store.close()
    os.chdir(ROOT)


def log_picture() -> None:
    """The torques of a real double pendulum in one run, as the nominal model and the other two runs predict them."""
    found = api.estimate("double-pendulum", "double-pendulum").estimate
    nominal = replace(found, held_out=found.nominal_held_out)
    shown, believed = left_out(found)[LOG_SHOWN], left_out(nominal)[LOG_SHOWN]
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
        save(figure, IMAGES / "log.png")
    shrink(IMAGES / "log.png")


def metaid(*arguments: str) -> None:
    """Runs a command as a user does."""
    program = [sys.executable, "-c", "from metaid.cli import main; main()", *arguments]
    subprocess.run(program, check=True, stdout=subprocess.DEVNULL)


def live_view(store: Store) -> None:
    """What a terminal shows half-way through a run, as SVG."""
    console = Console(record=True, width=90, file=io.StringIO(), force_terminal=True, markup=False, highlight=False)
    live = Live(store, "from-afar", False, console)

    drawn = False

    def watch(progress: Progress) -> None:
        nonlocal drawn
        time.sleep(0.02)  # as slow as a plant that is worth watching, for the rate and the time left
        live.update(progress)
        if progress.trials >= 500 and not drawn:
            drawn = True
            console.print(Group(*live._bar.get_renderables()))

    run_study(store, "from-afar", watch=watch)
    svg = console.export_svg(title="metaid study run from-afar")
    (IMAGES / "live.svg").write_text(re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL))


def figures(store: Store) -> None:
    """The figures that the documents show."""
    pictures = {"from-afar": ("convergence", "factors", "frequency"), "boundary": ("boundary",)}
    for study, names in pictures.items():
        gallery = Gallery(read_findings(store, study))
        for picture in gallery.pictures():
            if picture.name in names:
                save(picture.figure, IMAGES / f"{picture.name}.png")
                shrink(IMAGES / f"{picture.name}.png")
        if study == "from-afar":
            save(plant_figure(gallery.found.problem.make_plant()), IMAGES / "plant.png")
            shrink(IMAGES / "plant.png")
    save(plant_figure(load_plant("pa10")), IMAGES / "arm.png")
    shrink(IMAGES / "arm.png")


def dashboard(store: Store, browser: Browser) -> None:
    """The note and the graphs of a study on the dashboard."""
    with make_dashboard(store, 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        study = store.optuna.get_study_id_from_name("from-afar")
        browser.look(f"http://127.0.0.1:{server.server_port}/dashboard/studies/{study}")
        time.sleep(5)
        shoot(browser, "dashboard.png", 1200, 1900)
        server.shutdown()


def shoot(browser: Browser, name: str, width: int, height: int) -> None:
    """A picture of the page's beginning."""
    clip = {"x": 0, "y": 0, "width": width, "height": height, "scale": 1}
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    time.sleep(1)
    shot = browser.driver.execute_cdp_cmd("Page.captureScreenshot", {"captureBeyondViewport": True, "clip": clip})
    (IMAGES / name).write_bytes(base64.b64decode(shot["data"]))
    shrink(IMAGES / name)


def shrink(path: Path) -> None:
    """As few bytes as a picture of few colours needs."""
    Image.open(path).convert("RGB").quantize(128, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    main()
