"""The controller under your own MuJoCo loop: hold a pose, be pushed on the forearm, say what was felt.

Picture: how far 25 N on the forearm carry the tool, under each of the three presets.
"""

import mujoco
import numpy as np
from drawing import BAND, COLOUR, panels, save

import contactsafe as cs

PUSH = range(300, 1300)  # ms


def hold(config: cs.ControllerConfig, ticks: int = 1800) -> tuple[np.ndarray, cs.Contact]:
    """Hold a pose; return the distance of the tool from it, (ticks,), m, and the contact reported in mid-push."""
    arm = cs.robots.panda()
    model = arm.model  # a stand-in for your scene: any model whose first joints are the arm's
    data = mujoco.MjData(model)
    data.qpos[:] = arm.home

    controller = cs.Controller(arm, config)
    controller.reset(data.qpos)
    target = cs.Target(arm.tool_pose(arm.home), stiffness=np.array([150.0] * 3 + [450.0] * 3))

    error = np.zeros(ticks)
    for tick in range(ticks):
        data.xfrc_applied[model.body("link5").id, :3] = (0.0, 25.0, 0.0) if tick in PUSH else 0.0
        out = controller.step(cs.Measurement(data.qpos, data.qvel), target)
        data.ctrl[:] = out.torque
        mujoco.mj_step(model, data)
        error[tick] = np.linalg.norm(out.error[:3])
        if tick == PUSH.start + 500:
            contact = out.contact
    return error, contact


def main(folder: str = ".") -> dict[str, float]:
    """Draw, and return the tool's largest distance from its target for each controller, m."""
    figure, axis = panels()
    axis.axvspan(PUSH.start / 1000, PUSH.stop / 1000, color=BAND)
    axis.text(PUSH.start / 1000 + 0.02, 0.95, "25 N on link 5", transform=axis.get_xaxis_transform(), va="top")
    largest = {}
    for name, preset in cs.presets.PRESETS.items():
        error, contact = hold(preset())
        largest[name] = float(error.max())
        reported = f"contact on link {contact.link}" if contact.in_contact else "no contact"
        print(f"{name}: {reported}, tool at most {1000 * largest[name]:.1f} mm from its target")
        axis.plot(np.arange(len(error)) / 1000, 1000 * error, color=COLOUR[name], label=name)
    axis.set(xlabel="time (s)", ylabel="tool from its target (mm)", xlim=(0, 1.8), ylim=(0, None))
    axis.legend(loc="upper right", frameon=False)
    save(figure, __file__, folder)
    return largest


if __name__ == "__main__":
    main()
