"""The controller under your own MuJoCo loop: hold a pose, be pushed on the forearm, say what was felt."""

import mujoco
import numpy as np

import contactsafe as cs


def main(seconds: float = 1.5) -> float:
    """Run, and return the tool's largest error under the push, m."""
    arm = cs.robots.panda()
    model = arm.model  # a stand-in for your scene: any model whose first joints are the arm's
    data = mujoco.MjData(model)
    data.qpos[:] = arm.home

    controller = cs.Controller(arm, cs.presets.safe())
    controller.reset(data.qpos)
    target = cs.Target(arm.tool_pose(arm.home), stiffness=np.array([150.0] * 3 + [450.0] * 3))

    largest = 0.0
    for tick in range(round(1000 * seconds)):
        if tick == 300:
            data.xfrc_applied[model.body("link5").id, :3] = (0.0, 25.0, 0.0)
        out = controller.step(cs.Measurement(data.qpos, data.qvel), target)
        data.ctrl[:] = out.torque
        mujoco.mj_step(model, data)
        if tick in (299, 400):
            print(f"{tick} ms: contact {out.contact.in_contact}, link {out.contact.link}, pushed {out.contact.holding}")
        largest = max(largest, float(np.linalg.norm(out.error[:3])))
    print(f"largest tool error: {1000 * largest:.1f} mm")
    return largest


if __name__ == "__main__":
    main()
