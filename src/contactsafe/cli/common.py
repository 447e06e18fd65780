"""What commands have in common: kinds of options, the progress bar, and the word before the first compilation."""

import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import tyro
from tqdm import tqdm

from contactsafe.control import presets
from contactsafe.core.compiled import CACHE_FOLDER
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.parse import one_of, some_of
from contactsafe.core.progress import progress_bar
from contactsafe.policy.bundle import Bundle, shipped_bundle
from contactsafe.tasks import DEFAULT_TASK, TASKS
from contactsafe.tasks.base.registry import TASK_FORM

COMPILES = "the first run compiles for a minute or two"

TaskName = Annotated[str, one_of(TASKS, also=TASK_FORM)]
Controllers = Annotated[tuple[str, ...], some_of(presets.PRESETS, check=presets.by_name, also=presets.FORM)]
BundleFolder = Annotated[Path | None, tyro.conf.arg(help_behavior_hint="(default: the shipped one)")]


def load_bundle(folder: Path | None, task: str = DEFAULT_TASK) -> Bundle:
    """Load a bundle from its folder; the one that is shipped for the task where there is no folder.

    Raises:
        BundleError: it cannot be used, or none is shipped.
        InvalidInputError: it is of another task.
    """
    bundle = Bundle.load(folder or shipped_bundle(task))
    of = bundle.manifest["task"]
    if of != task:
        raise InvalidInputError(f"{bundle.folder} is a policy for the task {of}, not for {task}; give --task {of}")
    return bundle


def task_of(words: Sequence[str]) -> str:
    """Return the task that words name; that decides which options there are, and their defaults."""
    for k, word in enumerate(words):
        name, _, value = word.partition("=")
        value = value or "".join(words[k + 1 : k + 2])
        if name == "--task" and value in TASKS:
            return value
    return DEFAULT_TASK


@functools.cache
def first_run() -> bool:
    """Tell whether this version has compiled nothing yet; asked once, before it does."""
    return not any(Path(CACHE_FOLDER).rglob("*.nbi"))


def described(what: str) -> str:
    """Return what is being done, and that it compiles first where it does."""
    return f"{what} ({COMPILES})" if first_run() else what


def progress(what: str, total: int) -> tqdm:
    """Begin to show progress on stderr."""
    return progress_bar(total=total, desc=described(what))
