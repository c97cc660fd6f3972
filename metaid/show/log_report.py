"""What logs say as one self-contained HTML page, by the template of study reports."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from metaid.recorded import FileError, RecordedResult
from metaid.show.figures.log_gallery import LogGallery
from metaid.show.pages import filled_in, page_figures


def render_log(found: RecordedResult, command: str = "", files: Sequence[FileError] = ()) -> str:
    """The page, with `files` that were written, and the `command` that made it, by which it can be repeated; none in
    Python.
    """
    gallery, summary = LogGallery(found), found.summary_with(files)
    return filled_in(
        "log.html",
        summary=summary,
        motion=summary["held_out"]["motion"],
        joints=_joints(found, summary),
        has_zeros=found.estimate.equations.zeros,
        settings=_settings(summary),
        figures=page_figures(gallery),
        expressions={row["name"]: row["expression"] for row in summary["parameters"] if row["expression"]},
        command=command,
    )


def _joints(found: RecordedResult, summary: dict[str, Any]) -> list[dict[str, Any]]:
    """How well the torque and the motion of each joint are predicted; angles in mrad, or mm."""
    held, nominal, slides = summary["held_out"], summary["nominal_held_out"], found.estimate.model.slides.tolist()
    motion = held["motion"]
    shown = {"angle": motion["angle"], "still": motion["constant_speed"]}
    return [
        {
            **joint,
            "nominal": nominal["torque"]["joints"][i]["relative"],
            **{key: None if each[i] is None else 1e3 * each[i] for key, each in shown.items()},
            "unit": "N" if slides[i] else "N m",
            "angle_unit": "mm" if slides[i] else "mrad",
        }
        for i, joint in enumerate(held["torque"]["joints"])
    ]


def _settings(summary: dict[str, Any]) -> dict[str, str]:
    """What was chosen, by what each text is about."""
    window, friction = summary["window"], summary["friction"]
    said: dict[str, str] = {}
    if summary["gains"] is not None:
        said["Gains"] = "; ".join(
            f"{row['joint']} {row['gain']:.4g} ± {row['sd']:.2g}{'' if row['determined'] else ' (not told)'}"
            for row in summary["gains"]
        )
    if summary["nominal_repairs"]:
        said["Nominal robot"] = "; ".join(summary["nominal_repairs"])
    coupled = "".join(f"; joints {one} and {other} share motors" for one, other in friction["coupled"])
    return {
        "Motion": f"{window['moving_s']:.4g} s of {sum(log['seconds'] for log in summary['logs']):.4g} s",
        "Windows": f"{window['count']} of {window['seconds']:g} s, polynomials of degree {window['degree']}",
        "Filter": f"torques below {window['cutoff_hz']:g} Hz",
        "Friction": (", ".join(friction["terms"]) or "none") + coupled,
        "Delay": f"torques act {1e3 * summary['delay']:.3g} ms later than they are logged"
        if summary["delay"]
        else "none",
        "Misfit": f"{summary['misfit']:.3g} deviations of what the noise of the angles would leave",
        **said,
    }
