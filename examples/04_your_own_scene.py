"""Your own arm in your own MuJoCo scene and loop: the forearm meets a box that nobody planned for.

Picture: the force on the box over time, with and without contact safety.
"""

from pathlib import Path

import mujoco
import numpy as np
from drawing import COLOUR, panels, save

import contactsafe as cs

SCENE = Path(__file__).with_name("own_scene.xml")
STIFFNESS = np.array([150.0] * 3 + [450.0] * 3)


def sweep(start: cs.Target, tick: int) -> cs.Target:
    """Carry the tool 25 cm to the left of where it starts within 1.5 s."""
    done = min(tick / 1500, 1.0)
    left = np.array([0.0, 0.25, 0.0]) * done**2 * (3.0 - 2.0 * done)
    return start._replace(pose=start.pose._replace(position=start.pose.position + left))


def collide(config: cs.ControllerConfig, ticks: int = 3000) -> tuple[np.ndarray, int]:
    """Sweep; return the force on the box, (ticks,), N, and the link reported at the end, 0 for none."""
    model = mujoco.MjModel.from_xml_path(str(SCENE))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    mujoco.mj_forward(model, data)

    arm = cs.robots.from_mjcf(SCENE, site="tip")
    at = arm.bind(model)
    controller = cs.Controller(arm, config)
    controller.reset(data.qpos[at.qpos])
    start = cs.Target(arm.tool_pose(arm.home), STIFFNESS, posture=arm.home)

    force = np.zeros(ticks)
    for tick in range(ticks):
        measured = cs.Measurement(data.qpos[at.qpos], data.qvel[at.dof], at.wrench(data))
        out = controller.step(measured, sweep(start, tick))
        data.ctrl[at.ctrl] = out.torque / at.gear
        mujoco.mj_step(model, data, at.steps)
        force[tick] = data.sensor("box").data[0]
    return force, out.contact.link if out.contact.in_contact else 0


def main(folder: str = ".") -> dict[str, float]:
    """Draw, and return the lasting force on the box (mean of the last half second) for each controller, N."""
    figure, axis = panels()
    lasting = {}
    for name, config in (("vices", cs.presets.vices()), ("safe", cs.presets.safe())):
        force, link = collide(config)
        lasting[name] = float(force[-500:].mean())
        reported = f"contact reported on link {link}" if link else "no contact reported"
        print(f"{name}: {reported}; the box feels {force.max():.0f} N at the impact, {lasting[name]:.0f} N in the end")
        axis.plot(np.arange(len(force)) / 1000, force, color=COLOUR[name], label=name)
    axis.set(xlabel="time (s)", ylabel="force on the box (N)", xlim=(0, 3), ylim=(0, None))
    axis.legend(loc="upper right", frameon=False)
    save(figure, __file__, folder)
    return lasting


if __name__ == "__main__":
    main()
