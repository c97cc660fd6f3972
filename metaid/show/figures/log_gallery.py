"""The figures of what logs say, as `metaid estimate` and its report have them: one a question, each with a caption."""

from __future__ import annotations

from matplotlib.figure import Figure

from metaid.recorded import RecordedResult, gravity_curves
from metaid.show.figures.gallery import LEAST_HEIGHT, Drawn, Maker, Pictures
from metaid.show.figures.logs import (
    plot_bodies,
    plot_friction,
    plot_gravity,
    plot_predicted_torque,
    plot_torque_residuals,
)
from metaid.show.figures.panels import panels, share_legend
from metaid.show.figures.style import verbatim

MOST = 12  # joints in a figure
LINE = 0.17  # inches, of a parameter


class LogGallery(Pictures):
    """All figures of what logs say; of gravity there is none where it loads no joint."""

    def __init__(self, found: RecordedResult) -> None:
        self.found = found
        self.joints = found.estimate.model.joints[:MOST]
        self._loaded = {curve.joint for curve in gravity_curves(found.estimate)} & set(self.joints)

    @property
    def makers(self) -> dict[str, Maker]:
        makers = {"torque": self._torque, "friction": self._friction, "gravity": self._gravity, "bodies": self._bodies}
        return {name: make for name, make in makers.items() if name != "gravity" or self._loaded}

    def _torque(self, width: float) -> Drawn:
        count = len(self.joints)
        figure = Figure(figsize=(width, 2.3 * count + 0.5), layout="constrained")
        axes = list(figure.subplots(2 * count, 1, sharex=True, height_ratios=[3, 2] * count, squeeze=False).flat)
        for joint, name in enumerate(self.joints):
            torque, residual = axes[2 * joint], axes[2 * joint + 1]
            plot_predicted_torque(self.found, joint, torque).set_title(f"joint {verbatim(name)}")
            plot_torque_residuals(self.found, joint, residual)
        for panel in axes:
            panel.label_outer()
        figure.align_ylabels(axes)
        share_legend(figure, axes[::2])
        what = "Each log" if self.found.estimate.held_out.by == "logs" else "Each third of a log"
        return figure, (
            f"{what} as the others predict it, one after the other between dotted lines; below each joint's torque "
            "what is left of it. Both sides are through the filter, rest is left out, of long logs a stretch is shown."
        )

    def _friction(self, width: float) -> Drawn:
        figure, axes = panels(width, len(self.joints))
        for joint, panel in enumerate(axes):
            plot_friction(self.found, joint, panel).set_title(f"joint {verbatim(self.joints[joint])}")
        share_legend(figure, axes)
        caption = "Friction over speed, with its 95 % band from repetition; what grows with load is at its usual load."
        return figure, caption

    def _gravity(self, width: float) -> Drawn:
        loaded = [joint for joint, name in enumerate(self.joints) if name in self._loaded]
        figure, axes = panels(width, len(loaded))
        for joint, panel in zip(loaded, axes, strict=True):
            plot_gravity(self.found, joint, panel).set_title(f"joint {verbatim(self.joints[joint])}")
        share_legend(figure, axes)
        return figure, (
            "The torque that holds each joint against gravity where it alone turns, with a 95 % band from repetition; "
            "the others are at the middle of their angles."
        )

    def _bodies(self, width: float) -> Drawn:
        height = max(0.8 + LINE * self.found.estimate.model.nbody, LEAST_HEIGHT)
        figure = Figure(figsize=(width, height), layout="constrained")
        plot_bodies(self.found, figure.subplots())
        caption = "What logs say of bodies and rotors beside the nominal ones; bars are 95 % intervals from repetition."
        return figure, caption
