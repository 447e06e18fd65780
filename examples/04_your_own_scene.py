"""Your own arm in your own MuJoCo scene and loop: the forearm meets a box that nobody planned for."""

from pathlib import Path

import mujoco
import numpy as np

import contactsafe as cs

SCENE = Path(__file__).with_name("own_scene.xml")
STIFFNESS = np.array([150.0] * 3 + [450.0] * 3)


def sweep(start: cs.Target, tick: int) -> cs.Target:
    """Carry the tool 25 cm to the left of where it starts within 1.5 s."""
    done = min(tick / 1500, 1.0)
    left = np.array([0.0, 0.25, 0.0]) * done**2 * (3.0 - 2.0 * done)
    return start._replace(pose=start.pose._replace(position=start.pose.position + left))


def collide(config: cs.ControllerConfig, ticks: int = 3000) -> tuple[float, float, int]:
    """Sweep; return the force on the box at its peak and over the last half second, N, and the link reported."""
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
    return force.max(), force[-500:].mean(), out.contact.link if out.contact.in_contact else 0


def main() -> dict[str, float]:
    """Run with and without contact safety, and return the lasting force on the box, N."""
    lasting = {}
    for name, config in (("vices", cs.presets.vices()), ("safe", cs.presets.safe())):
        peak, lasting[name], link = collide(config)
        reported = f"contact reported on link {link}" if link else "no contact reported"
        print(f"{name}: {reported}; the box feels {peak:.0f} N at the impact, {lasting[name]:.0f} N in the end")
    return lasting


if __name__ == "__main__":
    main()
