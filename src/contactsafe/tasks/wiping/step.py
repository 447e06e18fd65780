"""What is scored and observed after every policy step, compiled. Runs without the GIL."""

import numpy as np

from contactsafe.core.arrays import Record
from contactsafe.core.compiled import compiled
from contactsafe.tasks.base.record import end_step, force_excess, observe_arm
from contactsafe.tasks.wiping.camera import CameraTables, camera_at, render_mask_into
from contactsafe.tasks.wiping.ink import nearest_ink, remove_erased
from contactsafe.tasks.wiping.whiteboards import BoardArrays

REWARD_TERMS = ("ink", "done", "approach", "contact", "time", "force", "arm_table")

_f = np.float64
_i = np.int64

OWN_FIELDS = (
    ("ink_start", _i),  # cells at reset
    ("ink", _i),  # cells now
    ("distance", _f),  # from tool to nearest ink, m; 0 where there is none
    ("light", _i),  # seed of the episode's photographs; 0 where none are taken
)
"""What the task knows of one world beyond `task_dtype`."""

WEIGHTS = ("nearness", "force_limit_n", "gentle_n", "nearness_m", "clean_fraction")
"""What the reward is scored with beside the weight of each term."""

rewards_dtype = np.dtype([(name, _f) for name in (*REWARD_TERMS, *WEIGHTS)])


@compiled
def score(task: Record, metrics: Record, rewards: Record, ink: int, distance: float) -> None:
    """Fill the reward's terms of one step, and the step's ends.

    Finishing must pay best: `ink` and `done` are paid once for what is gone; `approach` is a difference, so it
    cannot be earned in circles; `contact` is less than `time` takes.
    """
    wiped = task.ink - ink
    task.success = 1 if ink <= rewards.clean_fraction * task.ink_start else 0
    task.failed = metrics.arm_touched
    touching = metrics.contact_ticks > 0 and metrics.tool_force_peak < rewards.force_limit_n
    task.reward[0] = rewards.ink * wiped / max(task.ink_start, 1)
    task.reward[1] = rewards.done * task.success
    task.reward[2] = rewards.approach * (task.distance - distance) if wiped == 0 else 0.0
    if rewards.nearness != 0.0:
        task.reward[2] += rewards.nearness * max(1.0 - distance / rewards.nearness_m, 0.0)
    task.reward[3] = rewards.contact if touching else 0.0
    task.reward[4] = rewards.time
    task.reward[5] = rewards.force * force_excess(metrics, rewards.gentle_n)
    task.reward[6] = rewards.arm_table * metrics.arm_touched
    task.ink, task.distance = ink, distance


@compiled(nogil=True)
def finish(
    start: int, stop: int, worlds: np.ndarray, controllers: np.ndarray, metrics: np.ndarray, boards: BoardArrays,
    rewards: Record, tasks: np.ndarray,
) -> None:  # fmt: skip
    """Score and look after the ticks of a step, in the worlds from start to stop, their boards erased.

    The arrays are those of `Worlds`, `Whiteboards` and `WipingTasks`.
    """
    for i in range(start, stop):
        world, board, cells, task = worlds[i], boards.records[i], boards.cells[i], tasks[i]
        camera = camera_at(boards.cameras, board.camera)
        remove_erased(boards.ink_index, i, cells, camera.pixels)
        ink, distance = nearest_ink(boards.ink_index, i, cells, board.origin, board.cell, world.truth.position)
        score(task, metrics[i], rewards, ink, distance)
        end_step(metrics[i], task)
        observe(world.plant, controllers[i], camera, boards.ink_index.shown[i], task, boards.masks[i])


@compiled
def observe(
    plant: Record, controller: Record, camera: CameraTables, shown: np.ndarray, task: Record, mask: np.ndarray
) -> None:
    """Fill what the policy sees: the tool's pose, where it is told to be and how stiffly, the force, the mask."""
    observe_arm(controller, task)
    render_mask_into(camera, shown, plant, mask)
