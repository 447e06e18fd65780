"""Train a policy on [pose, latent] with any algorithm of Stable-Baselines3, the free-space controller underneath."""

import json
from dataclasses import asdict, dataclass

import gymnasium
import torch
from stable_baselines3.common.logger import Logger
from tqdm import tqdm

from contactsafe.core.errors import BundleError, InvalidInputError, shown
from contactsafe.learning.checkpoints import CHECKPOINT, plain, run_folder, write_json
from contactsafe.learning.export import export_bundle
from contactsafe.learning.recorder import Curves, Recorder
from contactsafe.learning.run import Run, load_run
from contactsafe.learning.vec_env import EncodedVecEnv
from contactsafe.policy.bundle import (
    ENCODER,
    FOLDER,
    MAX_LATENT,
    MAX_MANIFEST_BYTES,
    MAX_MODEL_BYTES,
    digest,
    read_bounded,
)
from contactsafe.policy.dither import Dither
from contactsafe.policy.graph import check_ports, read_graph
from contactsafe.policy.observation import ObservationScaling
from contactsafe.policy.perception import (
    ENCODER_FORMAT,
    LEARNED,
    REPRESENTATIONS,
    Perception,
    encoder_ports,
    open_session,
)
from contactsafe.policy.policy import Policy
from contactsafe.tasks.base.evaluation import HELD_OUT_SEED, evaluate_policy


def train_policy(config, make_env=None, make_held_out=None):
    """Train, export a bundle, and evaluate it on held-out boards.

    Killed at any moment and resumed, a run ends with the same weights as one that was left alone: on one machine, with
    the same versions, as many threads, and an environment that has `state_dict` and `load_state_dict`.

    Args:
        config: a PolicyConfig of some algorithm, such as PpoConfig.
        make_env: `make_env(num_envs)` gives the vector environment; None makes config.env_id through Gymnasium.
        make_held_out: the same for the boards of the evaluation; None takes make_env.

    Returns:
        The results written into the bundle, a dict.

    Raises:
        InvalidInputError: no encoder in config.encoder, nothing to resume, or the run was started otherwise.
        OutputError: out cannot be written, or holds another run.
    """
    encoder = _Encoder.load(config.encoder)
    make_env = make_env or (lambda num_envs: gymnasium.make_vec(config.env_id, num_envs=num_envs))
    with run_folder(config.out, config.resume) as out:
        return _train(config, encoder, make_env, make_held_out or make_env, out)


def _train(config, encoder, make_env, make_held_out, out):
    state = load_run(config, encoder.digest) if config.resume else None
    torch.set_num_threads(config.threads)
    env = _encoded(make_env(config.num_envs), encoder, config)
    try:
        model, effort = _learn(config, env, encoder, state)
    finally:
        env.close()
    layers, description = config.actor(model), _describe(config, encoder, effort)
    folder = export_bundle(out / FOLDER, encoder.model, layers, env.scaling, description, force=True)
    if config.evaluate_episodes:
        description["results"] = _evaluate(folder, make_held_out, config)
        export_bundle(folder, encoder.model, layers, env.scaling, description, force=True)
    return description["results"]


@dataclass(frozen=True)
class _Encoder:
    """A vision encoder: bytes of encoder.onnx where there is one, what encoder.json says, SHA-256 of both."""

    model: bytes | None
    description: dict
    digest: str

    @classmethod
    def load(cls, folder):
        try:
            text = read_bounded(folder, "encoder.json", MAX_MANIFEST_BYTES)
            vae = json.loads(text)
            learned = vae["representation"] in LEARNED
            encoder = read_bounded(folder, ENCODER, MAX_MODEL_BYTES) if learned else None
            version = vae["format"]
        except (BundleError, ValueError, KeyError, TypeError, RecursionError) as error:
            remedy = f"run `contactsafe train vae --out {folder}` first"
            if (folder / CHECKPOINT).exists():
                remedy = "it is a run; give the folder in which `contactsafe train vae` has come to its end"
            raise InvalidInputError(
                f"{folder} holds no vision encoder (encoder.json, and encoder.onnx where it is learned); {remedy}"
            ) from error
        if version != ENCODER_FORMAT:
            raise InvalidInputError(
                f"{folder / 'encoder.json'} has format {shown(version)}, this version reads {ENCODER_FORMAT}; "
                f"run `contactsafe train vae --out {folder}` anew"
            )
        if not _is_valid(vae):
            raise InvalidInputError(
                f"{folder / 'encoder.json'} holds numbers that cannot be; "
                f"run `contactsafe train vae --out {folder}` anew"
            )
        return cls(encoder, vae, digest((encoder or b"") + text))


def _is_valid(vae):
    """Tell whether what encoder.json says can be used as it is."""
    statistics = vae.get("latent_mean"), vae.get("latent_std")
    return (
        vae["representation"] in REPRESENTATIONS
        and all(isinstance(vae.get(name), int | float) for name in ("size", "window_m"))
        and isinstance(vae["size"], int)
        and all(low <= vae[name] <= high for name, (low, high) in (("size", (8, 1024)), ("window_m", (0.01, 10.0))))
        and all(isinstance(numbers, list) and 1 <= len(numbers) <= MAX_LATENT for numbers in statistics)
        and len(statistics[0]) == len(statistics[1])
        and all(isinstance(number, int | float) and abs(number) < 1e6 for number in statistics[0] + statistics[1])
    )


def _encoded(raw_env, encoder, config):
    vae = encoder.description
    session = None
    if encoder.model is not None:
        name = str(config.encoder / ENCODER)
        graph = read_graph(encoder.model, name)
        check_ports(graph, name, *encoder_ports(vae["size"], len(vae["latent_mean"])))
        session = open_session(graph, name, config.encoder_threads)
    view = (vae["representation"], vae["window_m"], vae["size"])
    perception = Perception(session, *view, _homography(raw_env), threaded=True)
    scaling = ObservationScaling.from_statistics(config.observes, vae["latent_mean"], vae["latent_std"])
    dither = Dither(config.dither, rate_hz=config.rate_hz)
    return EncodedVecEnv(raw_env, perception, scaling, config.action_repeat, config.reward_scale, dither)


def _homography(env):
    return getattr(env, "unwrapped", env).camera_homography


def _learn(config, env, encoder, state):
    """Give the trained model, and how many steps and minutes it took over all sessions."""
    model = config.make_model(env)
    run = Run(config, model, env, encoder.digest)
    recorder = Recorder(run, 0.0 if state is None else run.load_state_dict(state))
    write_json(config.out / "config.json", plain(config))
    # Stable-Baselines3 adds these to the steps done: its total, which the learning rate falls by, stays total_steps.
    remaining = config.total_steps - model.num_timesteps
    if remaining > 0:
        model.set_logger(Logger(str(config.out), [Curves(config.out, model.num_timesteps)]))
        model.learn(remaining, callback=recorder, log_interval=None, reset_num_timesteps=False)
        recorder.finish()
    return model, {"steps": run.saved_steps, "minutes": round(recorder.minutes(), 1)}


def _describe(config, encoder, effort):
    return {
        "representation": encoder.description["representation"],
        "window_m": encoder.description["window_m"],
        "view_size": encoder.description["size"],
        "latent_size": len(encoder.description["latent_mean"]),
        "observes": list(config.observes),
        "rate_hz": config.rate_hz,
        "action_repeat": config.action_repeat,
        "dither": asdict(Dither(config.dither, rate_hz=config.rate_hz)),
        "training": {
            config.algorithm: _portable(plain(config)),
            "encoder": {
                key: _portable(value) if key == "config" else value
                for key, value in encoder.description.items()
                if not key.startswith("latent_")
            },
            **effort,
        },
        "results": {},
    }


def _portable(settings):
    """Leave out what names folders of this machine, or this session only."""
    return {key: value for key, value in settings.items() if key not in ("encoder", "out", "resume")}


def _evaluate(folder, make_env, config):
    env = make_env(min(config.num_envs, config.evaluate_episodes))
    try:
        policy = Policy(folder, _homography(env))
        with tqdm(total=config.evaluate_episodes, desc="held-out boards", unit="episode") as bar:
            seed = config.seed + HELD_OUT_SEED
            results = evaluate_policy(
                policy, env, config.evaluate_episodes, seed, config.rate_hz, lambda _: bar.update()
            )
    finally:
        env.close()
    del results["records"]
    return {**results, "seed": seed}
