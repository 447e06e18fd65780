"""Measurements that do not come: up to 20 ticks are bridged by a prediction, after more the arm is braked.

Picture: the tool on its path while measurements are lost for 20 ms, and for 60 ms.
"""

import mujoco
import numpy as np
from drawing import BAND, COLOUR, INK, SOFT, panels, save
from simulation import smooth

import contactsafe as cs

LOST_TICK, TICKS = 600, 1500
GAPS = {20: COLOUR["safe"], 60: SOFT}


def travel(gap: int) -> tuple[np.ndarray, np.ndarray, str]:
    """Move the tool 20 cm to the side; return its path and its target's, (TICKS,), m, and the fault at the end."""
    arm = cs.robots.panda()
    data = mujoco.MjData(arm.model)
    data.qpos[:] = arm.home
    controller = cs.Controller(arm)
    controller.reset(arm.home)
    pose = arm.tool_pose(arm.home)
    tool, target = np.zeros(TICKS), np.array([0.2 * smooth(tick / 1200) for tick in range(TICKS)])
    for tick in range(TICKS):
        lost = LOST_TICK <= tick < LOST_TICK + gap
        q = np.full(arm.n, np.nan) if lost else data.qpos
        wanted = pose._replace(position=pose.position + np.array([0.0, target[tick], 0.0]))
        measured = cs.Measurement(q, data.qvel, time=data.time)
        out = controller.step(measured, cs.Target(wanted, [600.0] * 6, posture=arm.home))
        data.ctrl[:] = out.torque
        mujoco.mj_step(arm.model, data)
        tool[tick] = arm.tool_pose(data.qpos).position[1] - pose.position[1]
    return tool, target, out.fault if out.braked else "none"


def main(folder: str = ".") -> dict[int, float]:
    """Draw, and return how far from the target the tool ends for each gap, m."""
    figure, axis = panels()
    times, off = np.arange(TICKS) / 1000, {}
    axis.axvspan(LOST_TICK / 1000, (LOST_TICK + max(GAPS)) / 1000, color=BAND)
    for gap, colour in GAPS.items():
        tool, target, fault = travel(gap)
        off[gap] = float(abs(tool[-1] - target[-1]))
        print(f"{gap} ms: {1000 * off[gap]:.0f} mm from the target in the end; fault: {fault}")
        axis.plot(times, 1000 * tool, color=colour, label=f"{gap} ms lost")
    axis.plot(times, 1000 * target, color=INK, linewidth=1.0, linestyle="--", label="target")
    axis.set(xlabel="time (s)", ylabel="displacement of the tool (mm)", xlim=(0, TICKS / 1000), ylim=(0, None))
    axis.legend(loc="upper left", frameon=False)
    save(figure, __file__, folder)
    return off


if __name__ == "__main__":
    main()
