"""The command line: the one place that composes everything."""

import datetime
import functools
import importlib.util
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import tyro
from tqdm import tqdm

import contactsafe
from contactsafe.control import presets
from contactsafe.core import process
from contactsafe.core.compiled import CACHE_FOLDER
from contactsafe.core.errors import ContactSafeError, InvalidInputError
from contactsafe.core.parse import call, docstring, one_of, parse, some_of
from contactsafe.experiments import registry
from contactsafe.experiments.config import PLANTS, ExperimentConfig
from contactsafe.policy.bundle import FOLDER, MANIFEST, Bundle, digest, shipped_bundle
from contactsafe.results.experiment import Experiment, to_json
from contactsafe.sim.drawings import Boards
from contactsafe.tasks import ENGINES
from contactsafe.tasks.wiping.config import Sight, WipingConfig
from contactsafe.tasks.wiping.scenes import Wiping
from contactsafe.tasks.wiping.scripted import REFERENCES

_COMPILES = "the first run compiles for a minute or two"

Controller = Annotated[str, one_of(presets.PRESETS)]
Joints = Annotated[tuple[str, ...], some_of(map(str, range(1, 15)))]
Controllers = Annotated[tuple[str, ...], some_of(presets.PRESETS)]
BundleFolder = Annotated[Path | None, tyro.conf.arg(help_behavior_hint="(default: the shipped one)")]


def _usual_trials() -> str:
    by_number: dict[int, list[str]] = {}
    for name, entry in registry.ENTRIES.items():
        by_number.setdefault(entry.trials, []).append(name)
    return "; ".join(f"{number} for {', '.join(names)}" for number, names in by_number.items())


def demo(
    out: Path = Path("contactsafe-demo"),
    trials: int = 10,
    seed: int = 0,
    controllers: Controllers = ExperimentConfig.controllers,
    bundle: BundleFolder = None,
) -> None:
    """Run the paper's three experiments and write a page about them.

    Args:
        out: folder for report.html, summary.json and the trials as CSV.
        trials: seeds tried with each controller.
        seed: first seed.
        controllers: presets to compare.
        bundle: folder of another policy.
    """
    from contactsafe.report import prepare_output, terminal_table, write_report

    loaded = Bundle.load(bundle or shipped_bundle())
    config = ExperimentConfig(controllers, trials, seed, task=Wiping(), bundle=loaded)
    folder = prepare_output(out)
    started = time.monotonic()
    results = _run(registry.PAPER, config)
    info = _run_info("contactsafe demo", config, time.monotonic() - started)
    page = write_report(folder, results, info)
    print(terminal_table(results))
    print(f"\nreport:  {page}\nsummary: {page.with_name('summary.json')}")


def experiment(
    name: Annotated[str, one_of(registry.ENTRIES), tyro.conf.Positional],
    controllers: Controllers = ExperimentConfig.controllers,
    trials: Annotated[int | None, tyro.conf.arg(help_behavior_hint=f"(default: {_usual_trials()})")] = None,
    seed: int = 0,
    plants: Annotated[tuple[str, ...], some_of(PLANTS)] = PLANTS,
    minutes: float = ExperimentConfig.minutes,
    out: Annotated[Path | None, tyro.conf.arg(help_behavior_hint="(default: none is written)")] = None,
    json: bool = False,
    bundle: BundleFolder = None,
) -> None:
    """Run one of the experiments.

      EXPERIMENTS

    The first two need a policy. A trial depends on its own seed alone: `--seed 17 --trials 1 --out DIR` runs trial 17
    of any batch once more and draws it.

    Args:
        name: what to run.
        controllers: presets to compare.
        trials: seeds tried with each controller.
        seed: first seed.
        plants: collisions with an arm and sensors that have errors (real), without any (clean), or both side by side.
        minutes: simulated time in which detection counts false alarms.
        out: folder for report.html, summary.json and the trials as NAME.csv.
        json: print tables, spreads and trials as JSON instead of text.
        bundle: folder of another policy.
    """
    from contactsafe.report import prepare_output, terminal_table, write_report
    from contactsafe.report.summary import summarise

    entry = registry.by_name(name)
    config = ExperimentConfig(controllers, entry.trials if trials is None else trials, seed, plants, minutes, Wiping())
    if bundle or entry.needs_policy:
        config = replace(config, bundle=Bundle.load(bundle or shipped_bundle()))
    folder = prepare_output(out) if out else None
    started = time.monotonic()
    results = _run([name], config)
    info = _run_info(f"contactsafe experiment {name}", config, time.monotonic() - started)
    page = write_report(folder, results, info) if folder else None
    print(to_json(summarise(results, info)) if json else terminal_table(results))
    if page:
        print(f"report: {page}", file=sys.stderr)


def evaluate(
    bundle: Annotated[BundleFolder, tyro.conf.Positional] = None,
    episodes: int = 50,
    seed: int = 0,
    controller: Controller = WipingConfig.controller,
    boards: Boards = WipingConfig.boards,
    sight: Sight = WipingConfig.sight,
    engine: Annotated[str, one_of(ENGINES)] = "mujoco",
    pushed: bool = False,
    randomised: bool = False,
    reference: Annotated[
        str | None, one_of(REFERENCES), tyro.conf.arg(help_behavior_hint="(default: the policy)")
    ] = None,
    json: bool = False,
) -> None:
    """Let a policy wipe boards it has never seen.

    Reports success, forces and times. For one seed and number of boards all policies and controllers meet the same.

    Args:
        bundle: folder of the policy.
        episodes: boards to wipe.
        seed: of boards, starts and noise.
        controller: preset underneath.
        boards: what is drawn on them; all but strokes need contactsafe[handwriting].
        sight: the ink as it is (mask), or as segmentation finds it in photographs (photograph).
        engine: what computes the physics.
        pushed: push the arm now and then, 5 to 25 N on links 3 to 6.
        randomised: every board another height, tilt, pad, camera and plant, as in training.
        reference: a script in place of the policy.
        json: print JSON instead of a table.
    """
    from contactsafe.policy.policy import Policy
    from contactsafe.sim.randomisation import Randomisation
    from contactsafe.tasks import make_engine
    from contactsafe.tasks.base.evaluation import FIGURES, HELD_OUT_SEED, evaluate_policy
    from contactsafe.tasks.base.pushes import Pushes
    from contactsafe.tasks.wiping import scripted as references

    if episodes < 1:
        raise InvalidInputError(f"episodes = {episodes}; give 1 or more")
    if seed < 0:
        raise InvalidInputError(f"seed = {seed}; give 0 or more")
    if reference is not None and bundle is not None:
        raise InvalidInputError(f"a bundle and --reference {reference} are both given; name one")
    loaded = None if reference else Bundle.load(bundle or shipped_bundle())
    config = WipingConfig(
        controller=controller,
        boards=boards,
        sight=sight,
        pushes=Pushes() if pushed else None,
        randomisation=Randomisation.broad() if randomised else None,
    )
    # PyBullet's boards run one after the other, and those that are done go on until the last is.
    most = 16 if engine == "mujoco" else 2
    env = make_engine(engine, max(n for n in range(1, most + 1) if episodes % n == 0), config)
    if loaded is None:
        policy = references.reference(str(reference), config, env, seed)
    else:
        policy = Policy(loaded, env.camera_homography)
    with _bar("boards", episodes) as bar:
        results = evaluate_policy(policy, env, episodes, HELD_OUT_SEED + seed, on_episode=lambda record: bar.update())
    env.close()
    records = results.pop("records")
    task = {"boards": boards, "sight": sight, "engine": engine, "pushed": pushed, "randomised": randomised}
    asked = {"policy": reference or str(bundle or "shipped"), "seed": seed, "controller": controller, "task": task}
    if json:
        print(to_json({**results, **asked, "boards": records}))
        return
    print(", ".join(f"{name} {value}" for name, value in {**asked, **task}.items() if name != "task"))
    for key, value in results.items():
        print(f"{key:24s}{value:>10{'d' if isinstance(value, int) else '.4g'}}  {FIGURES[key]}")


def bench(json: bool = False, bundle: BundleFolder = None) -> None:
    """Time the parts on this machine, as medians and ratios to bare physics.

    Args:
        json: print JSON instead of a table.
        bundle: folder of another policy.
    """
    from contactsafe.experiments.speed import ROUNDS, measure_speed

    loaded = Bundle.load(bundle or shipped_bundle())
    with _bar("rounds", ROUNDS) as bar:
        speeds = measure_speed(Wiping(), loaded, bar.update)
    if json:
        print(to_json([asdict(speed) for speed in speeds]))
        return
    print(f"{'':44s}{'median':>12s}{'fastest':>12s}{'ratio':>9s}")
    for speed in speeds:
        print(f"{speed.name:44s}{speed.median_us:9.1f} µs{speed.best_us:9.1f} µs{speed.ratio:9.2f}")
    per_step = next(speed for speed in speeds if speed.name.startswith("environment"))
    print(f"environment steps per second: {1e6 / per_step.median_us:.0f}")


def warmup(joints: Joints = ("6", "7")) -> None:
    """Compile everything for this machine beforehand: for container images and CI.

    What is compiled lies in a folder that this prints at the end, and stays good until this package, numba or NumPy
    changes; NUMBA_CACHE_DIR chooses another. In an image, build as the user and on the kind of processor that will run.

    Args:
        joints: of the arms that will be driven, 1 to 14: controllers are compiled for each number.
    """
    from contactsafe.warmup import steps

    started = time.monotonic()
    parts = steps(joints)
    with tqdm(total=len(parts), desc="compiling", file=sys.stderr) as bar:
        for name, run in parts.items():
            bar.set_description_str(name)
            run()
            bar.update()
    size = sum(path.stat().st_size for path in Path(CACHE_FOLDER).rglob("*") if path.is_file())
    print(f"compiled in {time.monotonic() - started:.0f} s: {CACHE_FOLDER}, {size / 1e6:.0f} MB")


def train(arguments: Sequence[str]) -> None:
    """Prepare the eyes (vae) or train a policy (ppo, sac)."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(
            "usage: contactsafe train {vae,ppo,sac} [options]\n\n"
            "  vae  the eyes: foveated ones, which need no training, or a β-VAE;\n"
            "       writes runs/vae\n"
            "  ppo  a policy on what it feels and sees; reads runs/vae,\n"
            "       writes runs/ppo and runs/ppo/bundle\n"
            "  sac  the same with SAC, which learns soon but does not get as far;\n"
            "       writes runs/sac\n\n"
            "All show a progress bar and log to TensorBoard. A run that was stopped or\n"
            "killed goes on with --resume from its last epoch or rollout, with the settings\n"
            "of its last session where none are given, and ends with the weights that it\n"
            "would have had. `contactsafe train ppo --help` lists the settings of PPO."
        )
        if not arguments:
            raise SystemExit(2)
        return
    name = arguments[0]
    if name not in ("vae", "ppo", "sac"):
        raise InvalidInputError(f"'contactsafe train {name}' is unknown; choose vae, ppo or sac")
    missing = [name for name in ("torch", "stable_baselines3", "tensorboard") if importlib.util.find_spec(name) is None]
    if missing:
        raise InvalidInputError(f"training needs {', '.join(missing)}; run: pip install 'contactsafe[train]'")
    if name == "vae":
        _train_vae(list(arguments[1:]))
    else:
        _train_policy(name, list(arguments[1:]))


def _settings(kind: type, program: str, words: list[str]) -> Any:
    """Read the settings of a training; where it goes on, those of its last session stay unless words say otherwise."""
    from contactsafe.learning.checkpoints import as_started

    config = parse(kind, program, words)
    return parse(kind, program, words, default=as_started(config)) if config.resume else config


def _train_vae(arguments: list[str]) -> None:
    from contactsafe.learning.train_vae import VaeConfig, train_vae
    from contactsafe.tasks.wiping.sampling import MaskSampler

    config = _settings(VaeConfig, "contactsafe train vae", arguments)
    sampler = MaskSampler()
    report = train_vae(config, sampler.sample, sampler.homography)
    shown = ("representation", "active_latents", "reconstruction", "nearest_ink")
    print(to_json({name: report[name] for name in shown if name in report}))
    print(f"eyes: {config.out}; next: contactsafe train ppo --vae {config.out}")


def _train_policy(algorithm: str, arguments: list[str]) -> None:
    import gymnasium

    from contactsafe.learning.algorithms import ALGORITHMS
    from contactsafe.learning.train_policy import train_policy
    from contactsafe.sim.randomisation import Randomisation

    config = _settings(ALGORITHMS[algorithm], f"contactsafe train {algorithm}", arguments)
    task = WipingConfig(randomisation=Randomisation.broad() if config.randomise else None)

    make_env = functools.partial(gymnasium.make_vec, config.env_id, config=task)
    make_held_out = functools.partial(gymnasium.make_vec, config.env_id, config=WipingConfig())
    if _first_run():
        print(f"contactsafe: {_COMPILES}", file=sys.stderr)
    results = train_policy(config, make_env, make_held_out)
    if results:
        print(to_json(results))
    print(f"policy: {config.out / FOLDER}; next: contactsafe evaluate {config.out / FOLDER}")


experiment.__doc__ = docstring(experiment).replace(
    "  EXPERIMENTS", "\n".join(f"  {entry.name:14s}{entry.about}" for entry in registry.ENTRIES.values())
)


@dataclass(frozen=True)
class _Command:
    run: Callable
    parses: bool = True


COMMANDS = {
    "demo": _Command(demo),
    "train": _Command(train, parses=False),
    "evaluate": _Command(evaluate),
    "experiment": _Command(experiment),
    "bench": _Command(bench),
    "warmup": _Command(warmup),
}


@functools.cache
def _first_run() -> bool:
    """Tell whether this version has compiled nothing yet; asked once, before it does."""
    return not any(Path(CACHE_FOLDER).rglob("*.nbi"))


def _described(what: str) -> str:
    return f"{what} ({_COMPILES})" if _first_run() else what


def _bar(what: str, total: int) -> tqdm:
    return tqdm(total=total, desc=_described(what), file=sys.stderr)


def _run(names: Sequence[str], config: ExperimentConfig) -> list[Experiment]:
    entries = {name: registry.by_name(name) for name in names}
    results = []
    with _bar(names[0], sum(entry.count(config) for entry in entries.values())) as bar:
        for name, entry in entries.items():
            bar.set_description_str(_described(name))
            results.append(entry.run(config, bar.update))
    return results


def _run_info(command: str, config: ExperimentConfig, seconds: float) -> dict:
    words = [command, f"--trials {config.trials} --seed {config.seed} --controllers {','.join(config.controllers)}"]
    if config.plants != ExperimentConfig.plants:
        words.append(f"--plants {','.join(config.plants)}")
    if config.minutes != ExperimentConfig.minutes:
        words.append(f"--minutes {config.minutes:g}")
    info = {
        "command": " ".join(words),
        "when": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "seeds": list(config.seeds),
        "seconds": round(seconds, 1),
    }
    if config.bundle is not None:
        info["bundle_sha256"] = digest((Path(config.bundle.folder) / MANIFEST).read_bytes())
    return info


def _help() -> str:
    lines = ["usage: contactsafe COMMAND [options]", ""]
    for name, command in COMMANDS.items():
        lines.append(f"  {name:12s}{docstring(command.run).partition(chr(10))[0]}")
    return "\n".join([*lines, "", "`contactsafe COMMAND --help` says more; `contactsafe --version` gives the version."])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; exit status 0 only when it did its job.

    Args:
        arguments: words after `contactsafe`. Where None, this process is the program: the words are its own, and so are
            streams and signals, see `contactsafe.core.process.run`.

    Returns:
        The exit status: 0, 1 where the command said in one line what is wrong, 2 where the words make no sense.
    """
    if arguments is None:
        return process.run(lambda: _main(sys.argv[1:]))
    return _main(arguments)


def _main(words: Sequence[str]) -> int:
    _first_run()
    if not words or words[0] in ("-h", "--help"):
        print(_help())
        return 0 if words else 2
    if words[0] == "--version":
        print(f"contactsafe {contactsafe.__version__}")
        return 0
    if words[0] not in COMMANDS:
        print(f"contactsafe: command '{words[0]}' is unknown; choose from {', '.join(COMMANDS)}", file=sys.stderr)
        return 2
    command = COMMANDS[words[0]]
    try:
        if command.parses:
            call(command.run, f"contactsafe {words[0]}", words[1:])
        else:
            command.run(words[1:])
    except ContactSafeError as error:
        print(f"contactsafe: {error}", file=sys.stderr)
        return 1
    except SystemExit as stop:  # tyro's, which has said why
        return stop.code if isinstance(stop.code, int) else 0
    return 0
