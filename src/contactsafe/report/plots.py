"""Curves over time as small SVG plots whose colours the page's style decides."""

import io
import itertools
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from contactsafe.report import data
from contactsafe.results.experiment import Experiment
from contactsafe.results.figures import Curve, Panel
from contactsafe.results.recording import Recording

_TEXT, _GRID, _BAND = "#010203", "#010204", "#010205"
_BINS = 240
_WIDTH_IN = {3: 3.5, 2: 5.4}  # inches, by columns of the page: all are shown at one scale, and so is their type
_ALONE_IN, _PANEL_IN, _NAME_IN = 1.8, 1.15, 0.16  # inches: height of a lone panel, of one of several, of a line of text
_LAYOUT = ConstrainedLayoutEngine(h_pad=0.03, w_pad=0.03, hspace=0.02)
_STYLE: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "contactsafe",
    "font.size": 9,
    "axes.edgecolor": _TEXT,
    "axes.labelcolor": _TEXT,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9,
    "axes.titlepad": 4,
    "axes.titlelocation": "left",
    "text.color": _TEXT,
    "xtick.color": _TEXT,
    "ytick.color": _TEXT,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "grid.color": _GRID,
    "grid.linewidth": 0.5,
}


class Plotter:
    """Draws plots whose controllers have the same colours and whose SVG ids never meet on one page.

    Args:
        names: all controllers of the page, in order.
    """

    def __init__(self, names: Sequence[str]):
        self._tokens = {name: f"#0102{16 + index:02x}" for index, name in enumerate(names)}
        self._count = 0

    def plot(
        self,
        experiment: Experiment,
        scenario: str,
        panels: Sequence[Panel],
        bands: Sequence[tuple[float, float]] = (),
        only: str | None = None,
        columns: int = 2,
    ) -> str:
        """Plot panels under each other, one curve a controller, named at its end.

        Args:
            experiment: whose recordings are plotted.
            scenario: which of them.
            panels: what to plot, from top to bottom.
            bands: spans of time to be shaded, s.
            only: the controller to plot; all where None.
            columns: of the page that the plot is one of, 2 or 3.

        Returns:
            An SVG element; empty where nothing was recorded.
        """
        recordings = [run for run in data.recorded(experiment, scenario) if only in (None, run.controller)]
        if not recordings:
            return ""
        height = 0.5 + (_ALONE_IN if len(panels) == 1 else _PANEL_IN) * len(panels)
        with rc_context(_STYLE):
            figure = Figure(figsize=(_WIDTH_IN[columns], height), layout=_LAYOUT)
            axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
            for axis, panel in zip(axes, panels, strict=True):
                self._panel(axis, recordings, panel, bands)
            self._name_curves(axes[0], recordings, panels[0].curve)
            axes[-1].set_xlabel("time (s)")
            buffer = io.StringIO()
            figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
        return self._inline(buffer.getvalue(), f"{scenario}: {', '.join(panel.title for panel in panels)} over time")

    def _panel(
        self, axis: Axes, recordings: Sequence[Recording], panel: Panel, bands: Sequence[tuple[float, float]]
    ) -> None:
        axis.set_title(panel.title)
        axis.grid(axis="y")
        axis.set_axisbelow(True)
        axis.locator_params(axis="y", nbins=4)
        for band in bands:
            axis.axvspan(*band, color=_BAND, linewidth=0)
        for recording in recordings:
            times, values, colour = data.seconds(recording), panel.curve(recording), self._tokens[recording.controller]
            if panel.noisy:
                middle, low, mean, high = scatter(times, values)
                axis.fill_between(middle, low, high, color=colour, alpha=0.22, linewidth=0)
                times, values = middle, mean
            axis.plot(*thin(times, values), color=colour, linewidth=0.9, solid_joinstyle="round")
        stop = max(data.seconds(recording)[-1] for recording in recordings)
        axis.set_xlim(0, stop)
        if axis.dataLim.ymin >= 0:
            axis.set_ylim(bottom=0)

    def _name_curves(self, axis: Axes, recordings: Sequence[Recording], curve: Curve) -> None:
        """Write each controller's name at the right, as high as its curve ends, or as where the curves differ most."""
        low, high = axis.get_ylim()
        curves = [curve(recording) for recording in recordings]
        common = np.array([values[: min(map(len, curves))] for values in curves])
        ends = np.array([np.mean(values[-50:]) for values in curves])
        apart_most = common[:, int(np.argmax(np.ptp(common, axis=0)))]
        if np.ptp(ends) < 0.1 * (high - low) <= np.ptp(apart_most):
            ends = apart_most
        gap = (high - low) * _NAME_IN / _PANEL_IN
        for index, place in zip(np.argsort(ends), apart(np.sort(ends), gap), strict=True):
            name = recordings[index].controller
            axis.annotate(
                name, (1.0, place), xycoords=("axes fraction", "data"), xytext=(4, 0), textcoords="offset points",
                color=self._tokens[name], va="center", fontweight="bold", fontsize=9, annotation_clip=False,
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
        for token, style in {_TEXT: "currentColor", _GRID: "var(--grid)", _BAND: "var(--band)"}.items():
            svg = svg.replace(token, style)
        for name, token in self._tokens.items():
            svg = svg.replace(token, f"var({data.css_variable(name)})")
        svg = re.sub(r"font: (bold |700 )?([\d.]+)px [^;\"]*", r"font: \1\2px var(--sans)", svg)  # matplotlib to 3.10
        return re.sub(r"font-family: [^;\"]*", "font-family: var(--sans)", svg).strip()


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
    for start, stop in itertools.pairwise(edges):
        part = values[start:stop]
        kept += sorted({start + int(np.argmin(part)), start + int(np.argmax(part))})
    index = np.array(sorted({0, *kept, len(values) - 1}))
    return times[index], values[index]


def scatter(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Summarise each of some hundred spans: middle of its time, smallest, mean and largest value.

    Args:
        times: (T,), s.
        values: (T,).
    """
    starts = np.unique(np.linspace(0, len(values), min(len(values), _BINS) + 1).astype(int))[:-1]
    counts = np.diff(starts, append=len(values))
    return (
        np.add.reduceat(times, starts) / counts,
        np.minimum.reduceat(values, starts),
        np.add.reduceat(values, starts) / counts,
        np.maximum.reduceat(values, starts),
    )


def spans(times: np.ndarray, active: np.ndarray, gap_s: float = 0.02) -> list[tuple[float, float]]:
    """Return the spans of time in which something is so, each to the sample after its last; near ones are one.

    Args:
        times: (T,), s.
        active: whether it is so, (T,).
        gap_s: largest gap between two spans that count as one, s.
    """
    found: list[tuple[float, float]] = []
    ends = np.append(times[1:], times[-1:])
    for start, stop in zip(times[active], ends[active], strict=True):
        begun = found.pop()[0] if found and start - found[-1][1] <= gap_s else start
        found.append((float(begun), float(stop)))
    return found


def apart(places: np.ndarray, gap: float) -> list[float]:
    """Push ascending places apart until none is nearer than `gap` to the next."""
    out = places.astype(float).tolist()
    for _ in range(50):
        for i in range(len(out) - 1):
            lack = max(0.0, gap - (out[i + 1] - out[i]))
            out[i] -= lack / 2
            out[i + 1] += lack / 2
    return out
