"""Curves over time as small SVG plots whose colours the page's style decides."""

import io
import re
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from contactsafe.report import data
from contactsafe.report.data import Experiment, Recording

Curve = Callable[[Recording], np.ndarray]
"""From a recording to one value a tick, (T,)."""

COLOURS = {"vices": ("#c4480a", "#f58549"), "paper": ("#9c5b86", "#d99cc2"), "safe": ("#0067a3", "#5ab4ea")}
"""Of the known controllers on light and dark ground: vermilion, purple, blue, apart for colour-blind readers too."""

SPARE = (("#00805d", "#3cc79f"), ("#7a6a00", "#e0cf4a"), ("#555555", "#b0b0b0"))
"""Of controllers not known, in the order they come."""

_INK, _GRID, _BAND = "#010203", "#010204", "#010205"
_BINS = 240
_PANEL_IN, _NAME_IN = 0.95, 0.15  # inches: height of one panel of several, of a line of text
_STYLE = {
    "svg.fonttype": "none",
    "svg.hashsalt": "contactsafe",
    "font.size": 8,
    "axes.edgecolor": _INK,
    "axes.labelcolor": _INK,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 8.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "text.color": _INK,
    "xtick.color": _INK,
    "ytick.color": _INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "grid.color": _GRID,
    "grid.linewidth": 0.5,
}


def colours(names: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Give each controller its colour on light and dark ground, the same everywhere."""
    spare = iter(SPARE * len(names))
    return {name: COLOURS.get(name) or next(spare) for name in names}


class Plotter:
    """Draws plots whose controllers have the same colours and whose SVG ids never meet on one page.

    Args:
        names: all controllers of the page, in order.
    """

    def __init__(self, names: Sequence[str]):
        self._tokens = {name: f"#0102{16 + index:02x}" for index, name in enumerate(names)}
        self._index = {name: index for index, name in enumerate(names)}
        self._count = 0

    def plot(
        self,
        experiment: Experiment,
        scenario: str,
        panels: Sequence[tuple[str, Curve]],
        title: str,
        band: tuple[float, float] | None = None,
    ) -> str:
        """Draw panels under each other, one curve a controller, named at its end.

        Args:
            experiment: whose recordings are drawn.
            scenario: which of them.
            panels: label with unit, and what to draw.
            title: above the first panel.
            band: span of time to be shaded, s.

        Returns:
            An SVG element; empty where nothing was recorded.
        """
        recordings = data.recorded(experiment, scenario)
        if not recordings:
            return ""
        height = 0.65 + (1.5 if len(panels) == 1 else _PANEL_IN) * len(panels)
        with rc_context(_STYLE):
            figure = Figure(figsize=(3.5, height), layout="constrained")
            figure.get_layout_engine().set(h_pad=0.03, w_pad=0.03, hspace=0.02)  # type: ignore[union-attr]
            axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
            axes[0].set_title(title)
            for axis, (label, curve) in zip(axes, panels, strict=True):
                self._panel(axis, recordings, curve, band)
                axis.set_ylabel(label)
            figure.align_ylabels(axes)
            self._name_curves(axes[0], recordings, panels[0][1])
            axes[-1].set_xlabel("time (s)")
            buffer = io.StringIO()
            figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
        return self._inline(buffer.getvalue(), f"{title}: {', '.join(label for label, _ in panels)} over time")

    def _panel(self, axis, recordings: Sequence[Recording], curve: Curve, band: tuple[float, float] | None) -> None:
        axis.grid(axis="y")
        axis.set_axisbelow(True)
        axis.locator_params(axis="y", nbins=4)
        if band is not None:
            axis.axvspan(*band, color=_BAND, linewidth=0)
        for recording in recordings:
            times, values = thin(data.seconds(recording), curve(recording))
            axis.plot(times, values, color=self._tokens[recording.controller], linewidth=1.0, solid_joinstyle="round")
        stop = max(data.seconds(recording)[-1] for recording in recordings)
        axis.set_xlim(0, stop)

    def _name_curves(self, axis, recordings: Sequence[Recording], curve: Curve) -> None:
        """Write each controller's name right of where its curve ends, pushed apart where they would meet."""
        low, high = axis.get_ylim()
        ends = [float(np.mean(values[-50:])) for values in map(curve, recordings)]
        gap = (high - low) * _NAME_IN / _PANEL_IN
        for index, place in zip(np.argsort(ends), apart(np.sort(ends), gap), strict=True):
            name = recordings[index].controller
            axis.annotate(
                name, (1.0, place), xycoords=("axes fraction", "data"), xytext=(4, 0), textcoords="offset points",
                color=self._tokens[name], va="center", fontweight="bold", fontsize=8, annotation_clip=False,
            )  # fmt: skip

    def _inline(self, svg: str, described: str) -> str:
        """Turn a file into an element: no prologue, no addresses, own ids, colours by CSS variables."""
        self._count += 1
        prefix = f"p{self._count}-"
        svg = svg[svg.index("<svg") :]
        svg = re.sub(r"<metadata>.*?</metadata>\s*", "", svg, flags=re.DOTALL)
        svg = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>\s*", "", svg, count=1, flags=re.DOTALL)
        box = re.search(r'viewBox="[^"]*"', svg)
        described = described.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
        head = f'<svg class="plot" role="img" aria-label="{described}" {box.group() if box else ""}>'
        svg = re.sub(r"<svg[^>]*>", lambda _: head, svg, count=1, flags=re.DOTALL)
        svg = svg.replace("xlink:href", "href")
        svg = re.sub(r'\bid="', f'id="{prefix}', svg)
        svg = re.sub(r'href="#', f'href="#{prefix}', svg)
        svg = svg.replace("url(#", f"url(#{prefix}")
        svg = re.sub(r"(\d+\.\d\d)\d+", r"\1", svg)
        for token, style in {_INK: "currentColor", _GRID: "var(--grid)", _BAND: "var(--band)"}.items():
            svg = svg.replace(token, style)
        for name, token in self._tokens.items():
            svg = svg.replace(token, f"var(--c{self._index[name]})")
        return re.sub(r"font: (bold |700 )?([\d.]+)px [^;\"]*", r"font: \1\2px var(--sans)", svg).strip()


def thin(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Keep smallest and largest value of each of some hundred spans: fewer points, every peak.

    Args:
        times: (T,), s.
        values: (T,).
    """
    if len(values) <= 2 * _BINS:
        return times, values
    edges = np.linspace(0, len(values), _BINS + 1).astype(int)
    kept = []
    for start, stop in zip(edges[:-1], edges[1:], strict=True):
        part = values[start:stop]
        kept += sorted({start + int(np.argmin(part)), start + int(np.argmax(part))})
    index = np.array(sorted({0, *kept, len(values) - 1}))
    return times[index], values[index]


def apart(places: np.ndarray, gap: float) -> list[float]:
    """Push ascending places apart until none is nearer than `gap` to the next."""
    out = places.astype(float).tolist()
    for _ in range(50):
        for i in range(len(out) - 1):
            lack = max(0.0, gap - (out[i + 1] - out[i]))
            out[i] -= lack / 2
            out[i + 1] += lack / 2
    return out
