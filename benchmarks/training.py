"""Policy steps a second of `contactsafe train ppo` as it is set up by default, and where the time goes.

    python benchmarks/training.py [rollouts]

It takes the time of rollouts and updates as training runs them, without writing checkpoints. The clock on the wall
splits each step into worlds, encoder, policy and bookkeeping, and update; then the worlds' processor time is split by
running their parts alone. Networks and boards are those of a beginner, who spends much time in contact.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback

from contactsafe.core.compiled import compiled
from contactsafe.learning.algorithms import PpoConfig
from contactsafe.learning.vec_env import EncodedVecEnv
from contactsafe.policy.dither import Dither
from contactsafe.policy.observation import ObservationScaling
from contactsafe.policy.perception import Perception
from contactsafe.sim.stepping import run_ticks
from contactsafe.tasks import make_vec, task_by_name
from contactsafe.tasks.wiping.camera import camera_at, render_mask_into
from contactsafe.tasks.wiping.ink import nearest_ink, remove_erased

ROLLOUTS = 6


class Clock(BaseCallback):
    """Adds up how long rollouts take; what is left of the whole are updates."""

    def __init__(self):
        super().__init__()
        self.rollouts = self.begun = 0.0

    def _on_rollout_start(self):
        self.begun = time.perf_counter()

    def _on_rollout_end(self):
        self.rollouts += time.perf_counter() - self.begun

    def _on_step(self):
        return True


def timed(owner, name, spent):
    """Have a method's calls timed, in `spent[name]`, s."""
    inner = getattr(owner, name)

    def outer(*arguments):
        begun = time.perf_counter()
        result = inner(*arguments)
        spent[name] = spent.get(name, 0.0) + time.perf_counter() - begun
        return result

    setattr(owner, name, outer)


def make(config):
    """Make the environment as `contactsafe train` does, on log-polar features whose statistics do not matter here."""
    task = task_by_name(config.task)
    raw = make_vec(
        task.name, config.num_envs, task.training_config(config.randomise, config.conditions, config.gentleness)
    )
    perception = Perception(None, "log_polar", 0.64, 128, raw.unwrapped.camera_homography, config.encoder_threads)
    zeros = np.zeros(perception.latent_size)
    scaling = ObservationScaling.from_statistics(raw.unwrapped.observation_vectors, zeros, zeros + 1.0)
    return EncodedVecEnv(raw, perception, scaling, dither=Dither(config.dither))


@compiled
def ticks_alone(worlds, controllers, noise, metrics, samples, trace, n):
    for i in range(worlds.shape[0]):
        for _ in range(n):
            run_ticks(worlds[i], controllers[i], noise[i], 17, metrics[i], samples[i], trace)


@compiled
def ink_alone(worlds, boards, cells, cameras, ink_index, n):
    found = 0
    for i in range(worlds.shape[0]):
        board = boards[i]
        camera = camera_at(cameras, board.camera)
        for _ in range(n):
            remove_erased(ink_index, i, cells[i], camera.pixels)
            found += nearest_ink(ink_index, i, cells[i], board.origin, board.cell, worlds[i].truth.position)[0]
    return found


@compiled
def masks_alone(worlds, boards, cameras, ink_index, masks, n):
    for i in range(worlds.shape[0]):
        camera = camera_at(cameras, boards[i].camera)
        for _ in range(n):
            render_mask_into(camera, ink_index.shown[i], worlds[i].plant, masks[i])


def processor_time(run, n, worlds):
    """Return the processor time of one step of one world, µs: the least of several tries."""
    best = np.inf
    for _ in range(5):
        begun = time.thread_time()
        run(n)
        best = min(best, time.thread_time() - begun)
    return 1e6 * best / (n * worlds)


def parts_alone(tasks):
    """Return what runs one part of all worlds' steps n times, by what it is."""
    worlds, boards = tasks.worlds, tasks.boards
    records, looks = worlds.records, (boards.cameras, boards.ink_index)
    ticks = (records, worlds.controllers, worlds.sample_noise(), worlds.metrics, worlds.samples, worlds.no_trace[0])
    return {
        "17 ticks of physics and control": lambda n: ticks_alone(*ticks, n),
        "ink counted, nearest found (nothing wiped)": lambda n: ink_alone(
            records, boards.records, boards.cells, *looks, n
        ),
        "mask": lambda n: masks_alone(records, boards.records, *looks, boards.masks, n),
        "noise of the sensors": lambda n: [worlds.sample_noise() for _ in range(n)],
    }


def main() -> None:
    """Measure and print."""
    rollouts = int(sys.argv[1]) if len(sys.argv) > 1 else ROLLOUTS
    with tempfile.TemporaryDirectory() as folder:
        config = PpoConfig(out=Path(folder), total_steps=10**7)
        torch.set_num_threads(config.threads)
        env = make(config)
        model, spent = config.make_model(env), {}
        model.learn(config.num_envs * config.rollout_steps)  # compiles
        tasks = env.env.unwrapped.tasks
        # Spread over their episodes, as they are after a while: so many end in every rollout.
        tasks.tasks["steps"] = np.linspace(0, tasks.step_limit, tasks.worlds.n, endpoint=False)
        timed(tasks.worlds, "in_threads", spent)
        timed(env.env, "step", spent)
        timed(env, "perception", spent)
        clock, steps = Clock(), rollouts * config.num_envs * config.rollout_steps
        begun = time.perf_counter()
        model.learn(steps, callback=clock, reset_num_timesteps=False)
        whole = time.perf_counter() - begun
        print(f"{steps / whole:7.0f} policy steps a second, {config.num_envs} worlds, {steps} steps")
        parts = {
            "worlds, in threads": spent["in_threads"],
            "resets, observations, rewards": spent["step"] - spent["in_threads"],
            "encoder, in threads": spent["perception"],
            "policy and bookkeeping": clock.rollouts - spent["step"] - spent["perception"],
            "update": whole - clock.rollouts,
        }
        for name, seconds in parts.items():
            print(f"{1e6 * seconds / steps:7.0f} us a step on the wall, {seconds / whole:4.0%}: {name}")
        for name, run in parts_alone(tasks).items():
            run(1)
            print(f"{processor_time(run, 4, tasks.worlds.n):7.1f} us of a core, one world: {name}")
        env.close()


if __name__ == "__main__":
    main()
