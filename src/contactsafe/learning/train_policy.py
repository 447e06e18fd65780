"""Train a policy on what a task lets it observe, with any algorithm of Stable-Baselines3; export and evaluate it."""

import json
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.logger import Logger

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.progress import progress_bar
from contactsafe.learning.checkpoints import run_folder, write_json
from contactsafe.learning.curves import Curves
from contactsafe.learning.export import export_bundle
from contactsafe.learning.policy_config import PolicyConfig
from contactsafe.learning.recorder import Recorder
from contactsafe.learning.run import Run, load_run
from contactsafe.learning.run_settings import plain
from contactsafe.learning.vec_env import EncodedVecEnv
from contactsafe.learning.vision_encoder import VisionEncoder
from contactsafe.policy.action_config import learned_actions
from contactsafe.policy.bundle import FOLDER
from contactsafe.policy.dither import Dither
from contactsafe.policy.observation import ObservationScaling, chosen
from contactsafe.policy.perception import NO_IMAGE, PAPER
from contactsafe.policy.policy import Policy
from contactsafe.results.experiment import to_json
from contactsafe.robot.calibration import Calibration
from contactsafe.tasks import TASKS, make_vec, task_by_name
from contactsafe.tasks.base.evaluation import HELD_OUT_SEED, evaluate_policy, side_by_side

_NEVER = sys.maxsize
"""Stable-Baselines3 logs once so many iterations; `Recorder` logs in its place."""

MakeEnv = Callable[[int], Any]
"""`make_env(num_envs)` returns a task's vector environment."""


def train_policy(
    config: PolicyConfig, make_env: MakeEnv | None = None, make_held_out: MakeEnv | None = None
) -> dict[str, Any]:
    """Train, export a bundle, and evaluate it on held-out episodes.

    Killed at any moment and resumed, a run ends with the same weights as one that was left alone: on one machine, with
    the same versions, as many threads, and an environment that has `state_dict` and `load_state_dict`.

    Args:
        config: settings of some algorithm, such as PpoConfig.
        make_env: makes the environments; None for those of config.task, as `contactsafe train` makes them. They have
            `observation_vectors`, and where the policy sees their mask `camera_homography`.
        make_held_out: the same for the evaluation; None takes make_env, or the task's where that is None.

    Returns:
        The results written into the bundle.

    Raises:
        InvalidInputError: no encoder in config.encoder, nothing to resume, or the run was started otherwise.
        OutputError: out cannot be written, or holds another run.
    """
    if make_env is None:
        make_env, usual_held_out = _environments(config)
        make_held_out = make_held_out or usual_held_out
    encoder = _encoder(config)
    with run_folder(config.out, config.resume) as out:
        return _train(config, encoder, make_env, make_held_out or make_env, out)


def _environments(config: PolicyConfig) -> tuple[MakeEnv, MakeEnv]:
    """Return how to make a task's environments: those for training, and the held-out ones."""
    task = task_by_name(config.task)
    training, nominal = (
        task.training_config(randomise, config.conditions, config.gentleness) for randomise in (config.randomise, False)
    )
    others: dict[str, Any] = {} if config.calibration is None else {"arm": Calibration.load(config.calibration)}
    return (
        lambda n: make_vec(task.name, n, training, **others),
        lambda n: make_vec(task.name, n, nominal, **others),
    )


def _encoder(config: PolicyConfig) -> VisionEncoder | None:
    """Load the vision encoder; None where the policy is to see no images."""
    if config.encoder is None or (config.task in TASKS and task_by_name(config.task).mask_sampler is None):
        return None
    encoder = VisionEncoder.load(config.encoder)
    found = encoder.description["representation"]
    if config.as_paper and found != PAPER:
        raise InvalidInputError(
            f"the encoder in {config.encoder} is of representation {found}, and the paper's is of {PAPER}; run "
            f"`contactsafe train vae --representation {PAPER} --out runs/vae_paper` and give that folder as --encoder"
        )
    return encoder


def _train(
    config: PolicyConfig, encoder: VisionEncoder | None, make_env: MakeEnv, make_held_out: MakeEnv, out: Path
) -> dict[str, Any]:
    state = load_run(config, encoder.digest if encoder else "") if config.resume else None
    torch.set_num_threads(config.threads)
    env = encoded(make_env(config.num_envs), encoder, config)
    try:
        model, effort = _learn(config, env, encoder, state)
    finally:
        env.close()
    description = _describe(config, env, encoder, effort)
    model_bytes = None if encoder is None else encoder.model
    bundle = out / FOLDER

    def export() -> None:
        export_bundle(bundle, model_bytes, config.actor(model), env.scaling, description, force=True)

    export()
    if config.evaluate_episodes:
        description["results"] = _evaluate(bundle, make_held_out, config)
        export()
    return description["results"]


def _homography(env: Any) -> Any:
    return getattr(getattr(env, "unwrapped", env), "camera_homography", None)


def encoded(raw_env: Any, encoder: VisionEncoder | None, config: PolicyConfig) -> EncodedVecEnv:
    """Make of a task's vector environment what an algorithm learns in.

    Args:
        raw_env: the task's.
        encoder: of its masks; None where the policy is to see none.
        config: the settings.
    """
    vectors = chosen(getattr(raw_env, "unwrapped", raw_env).observation_vectors, config.observes)
    dither = Dither(config.dither, rate_hz=config.rate_hz)
    perception, statistics = None, ((), ())
    if encoder is not None:
        perception = encoder.perception(_homography(raw_env), config.encoder_threads)
        statistics = encoder.description["latent_mean"], encoder.description["latent_std"]
    scaling = ObservationScaling.from_statistics(vectors, *statistics)
    repeat, actions = config.action_repeat, learned_actions(config.gains)
    return EncodedVecEnv(raw_env, perception, scaling, repeat, config.reward_scale, dither, actions)


def _learn(
    config: PolicyConfig, env: EncodedVecEnv, encoder: VisionEncoder | None, state: dict[str, Any] | None
) -> tuple[BaseAlgorithm, dict[str, Any]]:
    """Return the trained model, and how many steps and minutes it took over all sessions."""
    model = config.make_model(env)
    run = Run(config, model, env, encoder.digest if encoder else "")
    recorder = Recorder(run, 0.0 if state is None else run.load_state_dict(state))
    write_json(config.out / "config.json", plain(config))
    # Stable-Baselines3 adds these to the steps done: its total, which the learning rate falls by, stays total_steps.
    remaining = config.total_steps - model.num_timesteps
    if remaining > 0:
        model.set_logger(Logger(str(config.out), [Curves(config.out, model.num_timesteps)]))
        model.learn(remaining, callback=recorder, log_interval=_NEVER, reset_num_timesteps=False)
        recorder.finish()
    return model, {"steps": run.saved_steps, "minutes": round(recorder.minutes(), 1)}


def _describe(
    config: PolicyConfig, env: EncodedVecEnv, encoder: VisionEncoder | None, effort: dict[str, Any]
) -> dict[str, Any]:
    """Return what the bundle says of a policy beside its models."""
    spaces: Any = env.env.single_observation_space
    training = {config.algorithm: _portable(plain(config)), **_encoder_training(encoder)}
    return {
        "task": config.task,
        "conditions": asdict(config.conditions),
        **_image(encoder),
        "observes": [{"name": name, "size": spaces[name].shape[0]} for name in env.scaling.observes],
        "rate_hz": config.rate_hz,
        "action_repeat": config.action_repeat,
        "dither": asdict(env.dither),
        "training": {**training, **effort},
        "results": {},
    }


def _image(encoder: VisionEncoder | None) -> dict[str, Any]:
    """Return what the bundle says of the pictures that a policy sees."""
    if encoder is None:
        return {"representation": NO_IMAGE, "latent_size": 0}
    said = encoder.description
    shape = {"representation": said["representation"], "window_m": said["window_m"], "view_size": said["size"]}
    return {**shape, "latent_size": encoder.latent_size}


def _encoder_training(encoder: VisionEncoder | None) -> dict[str, Any]:
    """Return what the bundle says of how the encoder came about."""
    if encoder is None:
        return {}
    said = {key: value for key, value in encoder.description.items() if not key.startswith("latent_")}
    return {"encoder": {key: _portable(value) if key == "config" else value for key, value in said.items()}}


def _portable(settings: dict[str, Any]) -> dict[str, Any]:
    """Leave out what names folders of this machine, or this session only."""
    folders = ("out", "resume", *(name for name in ("encoder",) if isinstance(settings.get(name), str)))
    return {key: value for key, value in settings.items() if key not in folders}


def _evaluate(folder: Path, make_env: MakeEnv, config: PolicyConfig) -> dict[str, Any]:
    env = make_env(side_by_side(config.evaluate_episodes))
    try:
        policy = Policy(folder, _homography(env))
        with progress_bar(total=config.evaluate_episodes, desc="held-out episodes", unit="episode") as bar:
            seed = HELD_OUT_SEED + config.seed
            results = evaluate_policy(
                policy, env, config.evaluate_episodes, seed, config.rate_hz, lambda _: bar.update()
            )
    finally:
        env.close()
    del results["records"]
    return {**json.loads(to_json(results)), "seed": config.seed}  # as `evaluate` prints them: JSON knows no NaN
