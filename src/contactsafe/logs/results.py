"""A replay as results: declared for the page, the tables and JSON, as those of an experiment."""

import numpy as np

from contactsafe.logs.replay import Replay
from contactsafe.results.experiment import Experiment, Table
from contactsafe.results.figures import Curve, Figure, Panel
from contactsafe.results.recording import Recording
from contactsafe.sim.truth import trace_dtype

RESIDUAL, THRESHOLD = "residual", "threshold"

_TOUCHED = "touched"
_CAPTION = "External joint torque and the threshold with which its size is compared. Shaded: something touches."


def results_of(replay: Replay) -> Experiment:
    """Return a replay as an experiment without trials: what was felt, the robot's signals, and their curves."""
    return Experiment(
        "replay",
        f"Replay of {replay.log.source}",
        replay.verdict(),
        recordings=tuple(_recording(replay, name) for name in (RESIDUAL, THRESHOLD)),
        figures=(joint_figure(replay.log.n, _CAPTION, _TOUCHED),),
        tables=(_touches(replay), _signals(replay)),
    )


def _recording(replay: Replay, name: str) -> Recording:
    trace = np.zeros(len(replay.log.time), dtype=trace_dtype(replay.log.n))
    trace["time"] = replay.log.time
    values = replay.residual if name == RESIDUAL else replay.threshold
    curves = {str(i): values[:, i] for i in range(replay.log.n)}
    return Recording(replay.log.source, name, 0, trace, curves={**curves, _TOUCHED: replay.touched})


def joint_figure(n: int, caption: str, shaded: str) -> Figure:
    """Declare the plots of a log: a curve a joint, N m, kept under its number, and when something is so, shaded."""
    return Figure(
        plots=tuple((Panel(f"joint {i + 1}", "N m", _curve(i)),) for i in range(n)),
        caption=caption,
        shaded=lambda run: run.curves[shaded],
        of_a_log=True,
    )


def _curve(i: int) -> Curve:
    return lambda run: run.curves[str(i)]


def _touches(replay: Replay) -> Table:
    rows: tuple[tuple[str | float, ...], ...] = tuple(
        (
            f"{touch.start_s:.2f}",
            1000.0 * (touch.stop_s - touch.start_s),
            touch.kind,
            touch.link,
            touch.torque_nm,
            *(float(value) for value in touch.force),
            *(float(value) for value in touch.point),
            100.0 * touch.probability,
        )
        for touch in replay.touches
    )
    columns = (
        "begins (s)", "lasts (ms)", "kind", "link", "torque (N m)", "force x (N)", "y (N)", "z (N)", "at x (m)",
        "y (m)", "z (m)", "sure (%)",
    )  # fmt: skip
    note = "Largest torque of a joint; kind, link, force and place when it is largest. Sure: that it is arm, or tool."
    return Table("touches", "What was felt", columns, rows, note)


def _signals(replay: Replay) -> Table:
    size = np.abs(replay.residual)
    rows = tuple(
        (
            i + 1,
            float(np.sqrt(np.mean(size[:, i] ** 2))),
            float(size[:, i].max()),
            float(np.median(replay.threshold[:, i])),
            100.0 * float((size[:, i] / replay.threshold[:, i]).max()),
            100.0 * float(replay.offset[i]),
            float(replay.noise_nm[i]),
            replay.velocity_from[i],
        )
        for i in range(replay.log.n)
    )
    columns = (
        "joint", "residual, rms (N m)", "largest (N m)", "threshold, median (N m)", "largest of it (%)",
        "middle of it (%)", "noise (N m)", "velocity from",
    )  # fmt: skip
    note = (
        "Noise of the residual at full bandwidth, of which "
        f"{replay.bandwidth:.0%} is left to it. Velocity: the robot's own, or that of its positions, the quieter one."
    )
    return Table("signals", "The robot's joints", columns, rows, note)
