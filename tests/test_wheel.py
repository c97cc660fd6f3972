"""The wheel works on its own: installed into an empty environment, run from an empty folder."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).parent.parent


def test_wheel_carries_plants_and_studies_and_runs_from_an_empty_folder(tmp_path: Path) -> None:
    """Built, installed without the checkout, and asked to identify three links."""
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(tmp_path), str(ROOT)]
    subprocess.run(build, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    shipped = {Path(name) for name in zipfile.ZipFile(wheel).namelist()}
    for kind in ("plants", "studies"):
        assert {path.name for path in (ROOT / kind).glob("*.toml")} == {
            p.name for p in shipped if p.parent.name == kind
        }

    environment = tmp_path / "venv"
    venv.create(environment, with_pip=False)
    python = environment / "bin" / "python"
    # The dependencies are this environment's, by path; metaid itself comes from the wheel alone.
    install = [
        sys.executable,
        "-m",
        "pip",
        "--python",
        str(python),
        "install",
        "--quiet",
        "--no-deps",
        "--no-index",
        str(wheel),
    ]
    subprocess.run(install, check=True, capture_output=True)
    site = next((environment / "lib").glob("python*/site-packages"))
    (site / "dependencies.pth").write_text("\n".join(p for p in sys.path if p.endswith("site-packages")))

    folder = tmp_path / "empty"
    folder.mkdir()
    clean = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "METAID"))}

    def metaid(*arguments: str) -> str:
        command = [str(environment / "bin" / "metaid"), *arguments]
        return subprocess.run(command, cwd=folder, env=clean, check=True, capture_output=True, text=True).stdout

    where = subprocess.run(
        [str(python), "-c", "import metaid; print(metaid.__file__)"],
        cwd=folder,
        env=clean,
        check=True,
        capture_output=True,
        text=True,
    )
    assert str(environment) in where.stdout
    assert "three-link" in metaid("plant", "list")
    metaid("study", "create", "three-link")
    metaid("study", "run", "three-link")
    assert json.loads(metaid("study", "show", "three-link", "--json"))["max_error"] < 0.01
