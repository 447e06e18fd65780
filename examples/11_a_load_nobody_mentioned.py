"""2.5 kg in the gripper: not told, told before, and estimated by the controller itself and then taken over.

Picture: how far the load carries the tool from its target in each of the three cases.
"""

import mujoco
import numpy as np
from drawing import COLOUR, INK, SOFT, panels, save

import contactsafe as cs
from contactsafe.robot import carrying

CRATE = cs.Payload(mass=2.5, com=np.array([0.03, 0.0, 0.05]), inertia=np.eye(3) * 0.01)
ASKED_TICK = 2000
CASES = {"not told": SOFT, "estimated after 2 s": INK, "told": COLOUR["safe"]}


def carry(case: str, ticks: int = 4000) -> np.ndarray:
    """Hold a pose with the load in the hand; return the distance of the tool from its target, (ticks,), m."""
    arm = cs.robots.panda()
    plant = carrying(arm, CRATE).model  # the same arm with 2.5 kg in its hand
    data = mujoco.MjData(plant)
    data.qpos[:] = arm.home
    controller = cs.Controller(arm)
    controller.reset(arm.home)
    if case == "told":
        controller.set_payload(*CRATE)
    target = cs.Target(arm.tool_pose(arm.home), stiffness=[150.0] * 3 + [450.0] * 3)

    error = np.zeros(ticks)
    for tick in range(ticks):
        out = controller.step(cs.Measurement(data.qpos, data.qvel), target)
        data.qfrc_applied[:] = out.torque
        mujoco.mj_step(plant, data)
        error[tick] = np.linalg.norm(out.error[:3])
        if case == "estimated after 2 s" and tick == ASKED_TICK:
            found = controller.payload_estimate()
            print(f"it seems to carry {found.mass:.2f} kg")
            controller.set_payload(found.mass, found.com)
    return error


def main(folder: str = ".") -> dict[str, float]:
    """Draw, and return the distance at the end for each case, m."""
    figure, axis = panels()
    end = {}
    for case, colour in CASES.items():
        error = carry(case)
        end[case] = float(error[-1])
        print(f"{case}: {1000 * end[case]:.1f} mm in the end")
        axis.plot(np.arange(len(error)) / 1000, 1000 * error, color=colour, label=case)
    axis.set(xlabel="time (s)", ylabel="tool from its target (mm)", xlim=(0, 4), ylim=(0, None))
    axis.legend(loc="center right", frameon=False)
    save(figure, __file__, folder)
    return end


if __name__ == "__main__":
    main()
