"""One policy step of many wiping tasks, compiled: action, ticks, mask, reward. Runs without the GIL."""

import numpy as np

from contactsafe.core.compiled import compiled
from contactsafe.policy.action import apply_action, observed_pose, observed_target
from contactsafe.sim.camera import camera_at, render_mask_into
from contactsafe.sim.ink import nearest_ink, remove_erased
from contactsafe.sim.stepping import run_ticks, tool_position

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

rewards_dtype = np.dtype([(name, _f) for name in (*REWARD_TERMS, "force_limit_n", "gentle_n", "clean_fraction")])


@compiled
def score(task, report, rewards, ink, distance):
    """Fill the reward's terms of one step, and the step's ends.

    Finishing must pay best: `ink` and `done` are paid once for what is gone; `approach` is a difference, so it
    cannot be earned in circles; `contact` is less than `time` takes.
    """
    wiped = task.ink - ink
    task.clean = 1 if ink <= rewards.clean_fraction * task.ink_start else 0
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
    start, stop, plants, controllers, cells, noise, ticks, reports, traces, cameras, ink_index, limits, rule,
    actions, rewards, tasks, masks,
):  # fmt: skip
    """Run one policy step of each task from start to stop; the arrays are those of `Worlds` and `WipingTasks`."""
    for i in range(start, stop):
        apply_action(controllers[i], limits, rule, actions[i])
        run_ticks(plants[i], controllers[i], cells[i], noise[i], ticks[i], reports[i], traces[i])
        judge(i, plants[i], controllers[i], cells[i], reports[i], cameras, ink_index, rewards, tasks[i], masks[i])


@compiled
def judge(i, plant, controller, cells, report, cameras, ink_index, rewards, task, mask):
    """Score the step that world i has run and look at it; `ink_index` is that of all worlds, the rest is this one's."""
    camera = camera_at(cameras, plant.camera)
    remove_erased(ink_index, i, cells, camera.pixels)
    ink, distance = nearest_ink(ink_index, i, cells, plant.origin, plant.cell, tool_position(plant))
    score(task, report, rewards, ink, distance)
    task.steps += 1
    observe(plant, controller, camera, ink_index.shown[i], task, mask)


@compiled
def observe(plant, controller, camera, shown, task, mask):
    """Fill what the policy sees: the tool's pose, where it is told to be and how stiffly, the force, the mask."""
    observed_pose(controller, task.pose)
    observed_target(controller, task.pose, task.target)
    task.force[:] = controller.state.tool_wrench.force
    render_mask_into(camera, shown, plant, mask)
