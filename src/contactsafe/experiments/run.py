"""Running tasks under a policy or a script, with every tick recorded."""

from collections.abc import Callable

import numpy as np

from contactsafe.core.errors import BundleError
from contactsafe.experiments.results import Recording
from contactsafe.policy.bundle import Bundle
from contactsafe.policy.policy import Policy
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import MAX_TICKS, POLICY_RATE_HZ
from contactsafe.tasks.base.evaluation import HELD_OUT_SEED
from contactsafe.tasks.wiping.tasks import WipingTasks

Act = Callable[[dict[str, np.ndarray]], np.ndarray]
"""From a batch of observations to actions, (n, 18)."""


Progress = Callable[[int], object]
"""Told how many trials were just done."""


class Run:
    """What N tasks did, tick by tick.

    Attributes:
        traces: one array of `trace_dtype` records for each task.
        ended: policy step at which each task ended, (n,).
        clean: whether each task's board was clean when it ended.
        boards: the boards at every policy step that was kept, uint8 (F, n, rows, columns).
        board_every: ticks between them.
    """

    def __init__(
        self, traces: list[np.ndarray], ended: np.ndarray, clean: list[bool], boards: np.ndarray, board_every: int
    ):
        self.traces, self.ended, self.clean = traces, ended, clean
        self.boards, self.board_every = boards, board_every

    def recording(self, i: int, scenario: str, controller: str, seed: int, obstacle=None) -> Recording:
        """Give task i as a recording."""
        return Recording(scenario, controller, seed, self.traces[i], self.boards[:, i], self.board_every, obstacle)


def run_policy(tasks: WipingTasks, act: Act, steps: int, stop_when_clean: bool, board_every_steps: int = 12) -> Run:
    """Run a policy in all tasks from where they stand.

    Args:
        tasks: reset.
        act: the policy.
        steps: policy steps.
        stop_when_clean: end a task's trace when its board is clean or its arm met the table.
        board_every_steps: policy steps between kept boards.
    """
    n = tasks.worlds.n
    trace = np.zeros((n, MAX_TICKS), dtype=trace_dtype(tasks.arm.n))
    pieces: list[list[np.ndarray]] = [[] for _ in range(n)]
    ended = np.full(n, steps)
    clean = np.zeros(n, bool)
    boards, ticks = [tasks.worlds.cells.copy()], 0
    for step in range(steps):
        tasks.step(act(tasks.observation()), trace)
        ticks += int(tasks.worlds.reports["ticks"][0])
        share = tasks.tasks["ink"] / np.maximum(tasks.tasks["ink_start"], 1)
        for i in range(n):
            if ended[i] == steps:
                clean[i] = tasks.tasks["clean"][i] == 1
                rows = trace[i, : tasks.worlds.reports["ticks"][i]].copy()
                rows["ink_left"] = share[i]
                pieces[i].append(rows)
        if (step + 1) % board_every_steps == 0:
            boards.append(tasks.worlds.cells.copy())
        if stop_when_clean:
            ended = np.where((ended == steps) & tasks.terminated, step + 1, ended)
            if (ended <= step + 1).all():
                break
    board_every = round(board_every_steps * 1000 / 60)
    return Run([np.concatenate(p) for p in pieces], ended, clean.tolist(), np.array(boards), board_every)


def held_out(seed: int) -> np.random.Generator:
    """Give the generator of a trial's board and start: none that training has drawn from."""
    return np.random.default_rng(HELD_OUT_SEED + seed)


def policy_for(bundle: Bundle, tasks: WipingTasks) -> Policy:
    """Make the policy of a bundle for these tasks.

    Raises:
        BundleError: it was trained for another rate.
    """
    if bundle.rate_hz != POLICY_RATE_HZ or bundle.action_repeat != 1:
        raise BundleError(
            f"{bundle.folder} acts at {bundle.rate_hz:g} Hz, {bundle.action_repeat} steps an action; "
            f"experiments run at {POLICY_RATE_HZ} Hz, one step an action: give a bundle trained so"
        )
    return Policy(bundle, tasks.worlds.homography)


def holding() -> Act:
    """Give the policy that changes nothing."""
    return lambda observation: np.zeros((len(observation["pose"]), 18))
