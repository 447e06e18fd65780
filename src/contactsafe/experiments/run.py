"""Running a task's episodes under a policy or a script, with every tick recorded."""

from dataclasses import dataclass, field

import numpy as np

from contactsafe.experiments.task import Act, Episodes
from contactsafe.policy.bundle import Bundle
from contactsafe.policy.policy import Policy
from contactsafe.policy.rate import POLICY_RATE_HZ
from contactsafe.results.recording import Recording
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import MAX_TICKS
from contactsafe.tasks.base.evaluation import check_rate


@dataclass(frozen=True)
class Run:
    """What N episodes did, tick by tick.

    Attributes:
        traces: one array of `trace_dtype` records for each.
        curves: what each recorded beside it, by name, one value a tick.
        ended: policy step at which each ended, (n,).
        succeeded: whether each had reached its goal when it ended, (n,).
        pictures: of every policy step that was kept, uint8 (F, n, rows, columns).
        picture_every: ticks between them.
    """

    traces: list[np.ndarray]
    curves: list[dict[str, np.ndarray]]
    ended: np.ndarray
    succeeded: np.ndarray
    pictures: np.ndarray
    picture_every: int

    def recording(
        self, i: int, scenario: str, controller: str, seed: int, obstacle: tuple[float, float] | None = None
    ) -> Recording:
        """Return episode i as a recording."""
        return Recording(
            scenario,
            controller,
            seed,
            self.traces[i],
            obstacle,
            self.pictures[:, i],
            self.picture_every,
            self.curves[i],
        )


@dataclass
class _Pieces:
    """What one episode recorded so far, a piece a policy step."""

    traces: list[np.ndarray] = field(default_factory=list)
    curves: dict[str, list[np.ndarray]] = field(default_factory=dict)

    def add(self, trace: np.ndarray, curves: dict[str, float]) -> None:
        self.traces.append(trace.copy())
        for name, value in curves.items():
            self.curves.setdefault(name, []).append(np.full(len(trace), value))

    def joined(self) -> dict[str, np.ndarray]:
        return {name: np.concatenate(pieces) for name, pieces in self.curves.items()}


def run_policy(episodes: Episodes, act: Act, steps: int, to_the_end: bool = True, picture_every_steps: int = 12) -> Run:
    """Run a policy in all episodes from where they stand.

    Args:
        episodes: begun.
        act: the policy.
        steps: policy steps.
        to_the_end: go on where an episode is terminated; otherwise its trace ends there.
        picture_every_steps: policy steps between kept pictures.
    """
    n = episodes.worlds.n
    trace = np.zeros((n, MAX_TICKS), dtype=trace_dtype(episodes.arm.n))
    pieces = [_Pieces() for _ in range(n)]
    ended, succeeded = np.full(n, steps), np.zeros(n, bool)
    pictures = [episodes.pictures()]
    for step in range(steps):
        episodes.step(act(episodes.observation()), trace)
        curves, running = episodes.curves(), ended == steps
        succeeded = np.where(running, episodes.succeeded, succeeded)
        for i in np.flatnonzero(running).tolist():
            rows = trace[i, : episodes.worlds.metrics["ticks"][i]]
            pieces[i].add(rows, {name: float(values[i]) for name, values in curves.items()})
        if (step + 1) % picture_every_steps == 0:
            pictures.append(episodes.pictures())
        if not to_the_end:
            ended = np.where(running & episodes.terminated, step + 1, ended)
            if (ended <= step + 1).all():
                break
    picture_every = round(picture_every_steps * 1000 / POLICY_RATE_HZ)
    traces = [np.concatenate(piece.traces) for piece in pieces]
    return Run(traces, [piece.joined() for piece in pieces], ended, succeeded, np.array(pictures), picture_every)


def steps_in(duration_s: float) -> int:
    """Return the policy steps of a duration, s."""
    return round(duration_s * POLICY_RATE_HZ)


def policy_for(bundle: Bundle, episodes: Episodes) -> Policy:
    """Return the policy of a bundle for these episodes.

    Raises:
        InvalidInputError: it was trained for another rate.
    """
    policy = Policy(bundle, episodes.camera_homography)
    check_rate(policy)
    return policy
