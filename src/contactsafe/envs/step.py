"""One policy step of many wiping tasks, compiled: action, ticks, mask, reward. Runs without the GIL."""

import math

import numpy as np

from contactsafe.compiled import compiled
from contactsafe.envs.action import apply_action, observed_pose, observed_target
from contactsafe.sim.camera import camera_at, render_mask
from contactsafe.sim.stepping import run_ticks, tool_position
from contactsafe.sim.whiteboard import INK
from contactsafe.vision.words import WORD, words_of

REWARD_TERMS = ("ink", "done", "approach", "contact", "time", "force", "arm_table")

_f = np.float64
_i = np.int64

task_dtype = np.dtype(
    [
        ("steps", _i),  # policy steps since reset
        ("ink_start", _i),  # cells at reset
        ("ink", _i),  # cells now
        ("distance", _f),  # from tool to nearest ink, m; 0 where there is none
        ("pose", _f, (6,)),  # observation: tool position, m, and rotation vector from straight down, rad
        ("target", _f, (18,)),  # observation: x_d less the pose, m and rad; K1, 1/s²; D1, 1/s
        ("force", _f, (3,)),  # observation: of the board on the tool, as measured, smoothed, N
        ("reward", _f, (len(REWARD_TERMS),)),
        ("clean", _i),
        ("arm_touched", _i),
        ("force_mean", _f),  # of the step, N
        ("force_peak", _f),  # of the step, N
        ("light", _i),  # seed of the episode's photographs; 0 where none are taken
    ]
)
"""What the task knows of one world."""

rewards_dtype = np.dtype([(name, _f) for name in (*REWARD_TERMS, "force_limit_n", "gentle_n", "clean_share")])


@compiled
def nearest_ink(cells, origin, cell, position):
    """Count the ink and find how far the nearest of it lies from a point along the board.

    Args:
        cells: uint8, (rows, columns).
        origin: world corner of cell (0, 0), (2,), m.
        cell: edge, m.
        position: (≥ 2,), m.

    Returns:
        Number of ink cells; distance, m, 0 where there is none.
    """
    count = 0
    best = math.inf
    px, py = (position[0] - origin[0]) / cell - 0.5, (position[1] - origin[1]) / cell - 0.5
    columns = cells.shape[1]
    flat = cells.reshape(-1)
    words = words_of(flat)
    for w in range(words.shape[0] + 1):
        if w < words.shape[0] and words[w] == 0:
            continue
        i, j = WORD * w // columns, WORD * w % columns
        for p in range(WORD * w, min(WORD * (w + 1), flat.shape[0])):
            if flat[p] == INK:
                count += 1
                best = min(best, (i - px) * (i - px) + (j - py) * (j - py))
            j += 1
            if j == columns:
                i, j = i + 1, 0
    if count == 0:
        return 0, 0.0
    return count, math.sqrt(best) * cell


@compiled
def score(task, report, rewards, ink, distance):
    """Fill the reward's terms of one step, and the step's ends.

    Finishing must pay best: `ink` and `done` are paid once for what is gone; `approach` is a difference, so it
    cannot be earned in circles; `contact` is less than `time` takes.
    """
    wiped = task.ink - ink
    task.clean = 1 if ink <= rewards.clean_share * task.ink_start else 0
    task.arm_touched = report.arm_touched
    task.force_mean, task.force_peak = report.tool_force_mean, report.tool_force_peak
    touching = report.contact_ticks > 0 and report.tool_force_peak < rewards.force_limit_n
    excess = min(max(report.tool_force_peak / rewards.gentle_n - 1.0, 0.0), 4.0)
    task.reward[0] = rewards.ink * wiped / max(task.ink_start, 1)
    task.reward[1] = rewards.done * task.clean
    task.reward[2] = rewards.approach * (task.distance - distance) if wiped == 0 else 0.0
    task.reward[3] = rewards.contact if touching else 0.0
    task.reward[4] = rewards.time
    task.reward[5] = rewards.force * excess
    task.reward[6] = rewards.arm_table * report.arm_touched
    task.ink, task.distance = ink, distance


@compiled(nogil=True)
def step_tasks(
    start, stop, plants, controllers, cells, noise, ticks, reports, traces, cameras, limits, q_min, q_max, actions,
    rewards, tasks, masks,
):  # fmt: skip
    """Run one policy step of each task from start to stop; the arrays are those of `Worlds` and `WipingTasks`."""
    for i in range(start, stop):
        apply_action(controllers[i], limits, q_min, q_max, actions[i])
        run_ticks(plants[i], controllers[i], cells[i], noise[i], ticks[i], reports[i], traces[i])
        judge(plants[i], controllers[i], cells[i], reports[i], cameras, rewards, tasks[i], masks[i])


@compiled
def judge(plant, controller, cells, report, cameras, rewards, task, mask):
    """Score the step that one world has run and look at it."""
    ink, distance = nearest_ink(cells, plant.origin, plant.cell, tool_position(plant))
    score(task, report, rewards, ink, distance)
    task.steps += 1
    observe(plant, controller, cells, cameras, task, mask)


@compiled
def observe(plant, controller, cells, cameras, task, mask):
    """Fill what the policy sees: the tool's pose, where it is told to be and how stiffly, the force, the mask."""
    observed_pose(controller, task.pose)
    observed_target(controller, task.pose, task.target)
    task.force[:] = controller.state.tool_force
    render_mask(camera_at(cameras, plant.camera), cells, plant, mask)
