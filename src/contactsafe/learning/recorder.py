"""What happens beside the learning: numbers logged, progress, checkpoints, and the time allowed."""

import time

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback
from tqdm import tqdm

from contactsafe.core.copying import OfTraining
from contactsafe.core.progress import progress_bar
from contactsafe.learning.run import Run


class Recorder(OfTraining, BaseCallback):
    """Logs, shows progress and saves once a rollout, between updates; stops there when time is up.

    Args:
        run: the Run.
        minutes_before: trained in earlier sessions.
    """

    def __init__(self, run: Run, minutes_before: float):
        super().__init__()
        self.run = run
        self.config = run.config
        self.minutes_before = minutes_before
        self.started = time.monotonic()
        self.period = run.config.rollout_steps * run.config.num_envs
        self.over = False
        self.bar: tqdm = progress_bar(disable=True)

    def minutes(self) -> float:
        """Time trained over all sessions, min."""
        return self.minutes_before + self._session_minutes()

    def finish(self) -> None:
        """Log and save the last rollout, unless that was done."""
        if not self.over and self.model.num_timesteps > self.run.saved_steps:
            self._close_rollout()
        self.logger.close()

    def _on_training_start(self) -> None:
        name = self.config.algorithm.upper()
        self.bar = progress_bar(
            total=self.config.total_steps, initial=self.model.num_timesteps, desc=name, unit="step", mininterval=1.0
        )

    def _on_rollout_start(self) -> None:
        # The one place where Stable-Baselines3 calls back with nothing half done: no rollout begun, no update pending.
        limit = self.config.max_minutes
        self.over = bool(limit) and self._session_minutes() >= limit
        steps, saved = self.model.num_timesteps, self.run.saved_steps
        if saved < 0 or steps - saved >= self.period or (self.over and steps > saved):
            self._close_rollout()
        self.config.prepare_rollout(self.model)

    def _on_step(self) -> bool:
        self.bar.update(self.training_env.num_envs)
        return not self.over

    def _on_training_end(self) -> None:
        self.bar.close()

    def _session_minutes(self) -> float:
        return (time.monotonic() - self.started) / 60.0

    def _close_rollout(self) -> None:
        if self.model.num_timesteps:
            self._log()
        self.run.save(self.minutes())

    def _log(self) -> None:
        finished = self.run.env.finished
        for key in finished[-1] if finished else ():
            self.logger.record(f"episode/{key}", float(np.mean([episode[key] for episode in finished])))
        self.logger.record("time/minutes", self.minutes())
        if finished:
            shown = ("success", *self.run.env.metric_names[:1], "return")
            recent = {key: np.mean([episode[key] for episode in finished]) for key in shown}
            self.bar.set_postfix({key: f"{value:.2f}" for key, value in recent.items()}, refresh=False)
        self.model.dump_logs()
