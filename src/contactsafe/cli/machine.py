"""`contactsafe bench` and `contactsafe warmup`: how fast this machine is, and what compiles on it beforehand."""

import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from contactsafe.cli.common import BundleFolder, TaskName, load_bundle, progress
from contactsafe.cli.experiments import scenes_of
from contactsafe.core.compiled import CACHE_FOLDER, compile_in_silence
from contactsafe.core.parse import some_of
from contactsafe.core.progress import progress_bar
from contactsafe.results.experiment import to_json
from contactsafe.tasks import DEFAULT_TASK

Joints = Annotated[tuple[str, ...], some_of(map(str, range(1, 15)))]


def bench(json: bool = False, bundle: BundleFolder = None, task: TaskName = DEFAULT_TASK) -> None:
    """Time the parts on this machine, as medians and ratios to bare physics.

    Args:
        json: print JSON instead of a table.
        bundle: folder of another policy.
        task: what it does.
    """
    from contactsafe.experiments.speed import ROUNDS, measure_speed

    loaded = load_bundle(bundle, task)
    scenes = scenes_of(task, loaded)
    with progress("rounds", ROUNDS) as bar:
        speeds = measure_speed(scenes, loaded, bar.update)
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
    from contactsafe.cli.compiling import steps

    started = time.monotonic()
    compile_in_silence()
    parts = steps(joints)
    with progress_bar(total=len(parts), desc="compiling") as bar:
        for name, run in parts.items():
            bar.set_description_str(name)
            run()
            bar.update()
    size = sum(path.stat().st_size for path in Path(CACHE_FOLDER).rglob("*") if path.is_file())
    print(f"compiled in {time.monotonic() - started:.0f} s: {CACHE_FOLDER}, {size / 1e6:.0f} MB")
