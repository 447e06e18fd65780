"""`contactsafe train`: the vision encoder and the policies."""

import contextlib
import importlib.util
import shlex
import sys
from collections.abc import Iterator, Sequence
from typing import Any

from contactsafe.cli.common import COMPILES, first_run, task_of
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.parse import parse
from contactsafe.policy.bundle import FOLDER
from contactsafe.results.experiment import to_json
from contactsafe.tasks import DEFAULT_TASK, TASKS, task_by_name
from contactsafe.tasks.base.registry import place_of

KINDS = ("vae", "ppo", "sac")

_HELP = f"""usage: contactsafe train {{{",".join(KINDS)}}} [options]

  vae  the vision encoder: log-polar features, which need no training, or a
       β-VAE; writes runs/vae
  ppo  a policy; reads runs/vae where its task has a camera, writes runs/ppo
       and runs/ppo/bundle
  sac  the same with SAC, which learns soon but does not get as far;
       writes runs/sac

--task NAME says what is learned: {", ".join(TASKS)}. All show a progress bar
and log to TensorBoard. A run that was stopped or killed goes on with --resume
from its last epoch or rollout and ends with the weights that it would have had;
all settings but --max-minutes that are not given are those of its last session.
`contactsafe train ppo --task NAME --help` lists the settings of PPO, and those
that a task is learned with unless told otherwise."""


def train(arguments: Sequence[str]) -> None:
    """Prepare the vision encoder (vae) or train a policy (ppo, sac)."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(_HELP)
        if not arguments:
            raise SystemExit(2)
        return
    name = arguments[0]
    if name not in KINDS:
        raise InvalidInputError(f"'contactsafe train {name}' is unknown; choose {', '.join(KINDS[:-1])} or {KINDS[-1]}")
    missing = [name for name in ("torch", "stable_baselines3", "tensorboard") if importlib.util.find_spec(name) is None]
    if missing:
        raise InvalidInputError(f"training needs {', '.join(missing)}; run: pip install 'contactsafe[train]'")
    if name == "vae":
        _train_encoder(list(arguments[1:]))
    else:
        _train_policy(name, list(arguments[1:]))


def _settings(kind: type, program: str, words: list[str], default: Any) -> Any:
    """Read the settings of a training; where it goes on, those of its last session stay unless words say otherwise."""
    from contactsafe.learning.run_settings import as_started

    config = parse(kind, program, words, default=default)
    return parse(kind, program, words, default=as_started(config)) if config.resume else config


def _train_encoder(arguments: list[str]) -> None:
    from contactsafe.learning.train_vae import VaeConfig, train_vae

    config = _settings(VaeConfig, "contactsafe train vae", arguments, VaeConfig())
    make_sampler = task_by_name(config.task).mask_sampler
    if make_sampler is None:
        raise InvalidInputError(f"task '{config.task}' has no camera; it needs no vision encoder")
    sampler = make_sampler()
    with _saying_how_to_go_on("vae", config):
        report = train_vae(config, sampler.sample, sampler.homography)
    shown = ("representation", "active_latents", "reconstruction", "nearest_foreground")
    print(to_json({name: report[name] for name in shown if name in report}))
    print(f"encoder: {config.out}; next: contactsafe train ppo --encoder {config.out}")


def _train_policy(algorithm: str, arguments: list[str]) -> None:
    from contactsafe.learning.algorithms import ALGORITHMS
    from contactsafe.learning.train_policy import train_policy

    kind, as_paper = ALGORITHMS[algorithm], not {"--as-paper", "--as_paper"}.isdisjoint(arguments)
    usual = kind.for_task(task_of(arguments), as_paper)
    config = _settings(kind, f"contactsafe train {algorithm}", arguments, usual)
    if first_run():
        print(f"contactsafe: {COMPILES}", file=sys.stderr)
    with _saying_how_to_go_on(algorithm, config):
        results = train_policy(config)
    if results:
        print(to_json(results))
    print(f"policy: {config.out / FOLDER}; next: contactsafe evaluate {config.out / FOLDER}{_task_words(config.task)}")


@contextlib.contextmanager
def _saying_how_to_go_on(kind: str, config: Any) -> Iterator[None]:
    """Say of a training that is stopped which command goes on, where there is something to go on from."""
    from contactsafe.learning.checkpoints import CHECKPOINT

    try:
        yield
    except KeyboardInterrupt:
        if (config.out / CHECKPOINT).exists():
            command = f"contactsafe train {kind} --out {shlex.quote(str(config.out))} --resume"
            print(f"contactsafe: {command}{_task_words(config.task)} goes on from here", file=sys.stderr)
        raise


def _task_words(task: str) -> str:
    """Return the option that names a task, where it must be named."""
    return "" if task == DEFAULT_TASK else f" --task {place_of(task)}"
