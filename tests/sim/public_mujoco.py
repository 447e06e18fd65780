"""MuJoCo as a backend in Python, through its public API: what the compiled form must do, to the bit."""

import mujoco
import numpy as np

from contactsafe.sim.scene import build_plant


class PublicMujoco:
    """Obstacles that travel stay where they are."""

    def __init__(self, arm, config, tick_s):
        self._arm, self._config = arm, config
        self.model = build_plant(arm, config)
        self.data = mujoco.MjData(self.model)
        assert self.model.opt.timestep == tick_s

    def reset(self, q):
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[: self._arm.n] = q
        self.data.ctrl[:] = self._arm.dynamics(q, np.zeros(self._arm.n))["g"]
        mujoco.mj_forward(self.model, self.data)

    def read(self, world):
        truth, data, n = world["truth"], self.data, self._arm.n
        truth["q"], truth["qd"] = data.qpos[:n], data.qvel[:n]
        truth["position"], truth["rotation"] = data.site("tcp").xpos, data.site("tcp").xmat.reshape(3, 3)
        for name in ("wrist_force", "wrist_torque"):
            truth[name] = data.sensor(name).data
        truth["wrist_acceleration"] = data.sensor("wrist_accelerometer").data
        truth["tau_contact"] = data.qfrc_constraint[:n]
        self._read_fixtures(truth)
        for k in range(len(self._config.obstacles)):
            x, y, z = data.sensor(f"arm_obstacle{k}").data[1:4]
            truth["obstacle_force"][k] = np.sqrt(x**2 + y**2 + z**2)
            truth["obstacle_position"][k] = data.body(f"obstacle{k}").xpos

    def _read_fixtures(self, truth):
        truth["tip_wrench"], truth["tip_contacts"], truth["arm_contacts"] = 0.0, 0.0, 0.0
        for k in range(len(self._config.fixtures)):
            truth["arm_contacts"] += self.data.sensor(f"arm_fixture{k}").data[0]
            found, *rest = self.data.sensor(f"tip_fixture{k}").data
            if found > 0:
                force, torque, place = np.array(rest).reshape(3, 3)
                truth["tip_contacts"] += found
                truth["tip_wrench"][:3] += force
                truth["tip_wrench"][3:] += torque + np.cross(place - truth["position"], force)

    def write(self, world):
        world["pushed"] = self._push(world["push"])
        self.data.ctrl[:] = world["motor"]
        self.data.qfrc_applied[: self._arm.n] = world["pushed"] - world["drag"]

    def _push(self, push):
        """Joint torque Jᵀ F of the push in force, (n,), N m, summed in the order of a loop: BLAS may fuse."""
        if push["fraction"] == 0.0:
            return np.zeros(self._arm.n)
        R, J = self.data.xmat[push["body"]].reshape(3, 3), np.zeros((3, self.model.nv))
        x, y, z = push["point"]
        point = self.data.xpos[push["body"]] + (R[:, 0] * x + R[:, 1] * y + R[:, 2] * z)
        mujoco.mj_jac(self.model, self.data, J, np.zeros_like(J), point, push["body"])
        return sum(J[k, : self._arm.n] * push["force"][k] * push["fraction"] for k in range(3))

    def step(self):
        mujoco.mj_step(self.model, self.data)

    def place_fixture(self, name, position, quat):
        body = self.model.body(name).id
        self.model.body_pos[body], self.model.body_quat[body] = position, quat

    def set_tip_friction(self, friction):
        self.model.geom("tip").friction[0] = friction

    def close(self):
        pass
