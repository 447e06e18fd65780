"""Random arms under every preset: held, pushed, released, swept into something, driven to their limits.

    python benchmarks/random_arms.py                    a hundred arms; --arms 1000 --seed 0 for the table of the docs

Arms of 3 to 10 joints whose links have moments of inertia from 1e-6 to 10 kg m², on any base, with any tool, and with
motors that carry them twice over. A push is that of a hand: up to 30 N, and in no posture more than a third of what the
motors can hold or than gives a joint 300 rad/s², for a hand has mass and moves with what it pushes. Counted: runs in
which a joint stays beyond its speed limit for longer than braking takes and nobody is told (runaways), torques that are
not finite, and runs that ended in a fault; each of these is named. Each number of joints compiles for itself.
"""

import argparse
import time
from typing import NamedTuple

import mujoco
import numpy as np

import contactsafe as cs

HELD, PUSHED, RELEASED, SWEPT, LIMITS = 300, 800, 1300, 2300, 3300
"""Ticks at which each part of a run ends."""

PUSH_RAD_S2 = 300.0
"""Largest joint acceleration of a push: a hand has mass, and does not fling what weighs nothing."""

SPEED_LIMIT = 4.0 * np.pi  # rad/s, that `Controller` takes where an MJCF model names none
STIFFNESS = np.array([150.0] * 3 + [450.0] * 3)


class Run(NamedTuple):
    """What happened in one run.

    Attributes:
        finite: whether every torque was a finite number.
        overspeed: longest time that a joint was beyond its speed limit, as a fraction of what braking takes.
        speed: largest joint speed, rad/s.
        energy: largest energy that the command had given the arm since the start, J.
        fault: of the controller.
    """

    finite: bool
    overspeed: float
    speed: float
    energy: float
    fault: str

    @property
    def runaway(self) -> bool:
        """Whether the arm ran away in silence."""
        return self.overspeed > 1.0 and self.fault == "none"


def random_arm(rng: np.random.Generator, n: int) -> mujoco.MjSpec:
    """Draw an arm of n joints beside an obstacle that it may meet, with motors that can carry it."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = 0.001
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    body = spec.worldbody.add_body(pos=rng.uniform(-1.0, 1.0, 3), quat=_quat(rng))
    _link(body, rng, 1.0)
    for k in range(n):
        offset = rng.normal(size=3)
        body = body.add_body(name=f"b{k}", pos=offset / np.linalg.norm(offset) * rng.uniform(0.0, 0.4), quat=_quat(rng))
        moment = _link(body, rng, 10.0 ** rng.uniform(-6.0, 1.0 - 3.0 * k / n))
        axis = np.eye(3)[rng.integers(3)] if rng.random() < 0.6 else rng.normal(size=3)
        armature = 0.0 if rng.random() < 0.6 else moment * 10.0 ** rng.uniform(-2.0, 1.0)
        body.add_joint(
            name=f"j{k}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, armature=armature,
            limited=True, range=(-rng.uniform(1.2, 3.0), rng.uniform(1.2, 3.0)),
        )  # fmt: skip
    body.add_site(name="tip", pos=rng.normal(size=3) * 0.1)
    obstacle = spec.worldbody.add_body(name="obstacle", mocap=True)
    obstacle.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.05, 0.0, 0.0), contype=2, conaffinity=1)
    limits = _strength(spec.compile(), n, rng)
    for k in range(n):
        motor = spec.add_actuator(name=f"j{k}", target=f"j{k}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_motor()
        motor.ctrllimited, motor.ctrlrange = True, (-limits[k], limits[k])
    return spec


def _quat(rng):
    quat = rng.normal(size=4)
    return quat / np.linalg.norm(quat)


def _link(body, rng, moment: float) -> float:
    """Set a random inertia of this size, and a sphere that may touch things."""
    radius = rng.uniform(0.02, 0.1)
    body.explicitinertial = True
    body.mass = min(moment / radius**2, 10.0)
    body.ipos = rng.normal(size=3) * radius * (rng.random() < 0.6)
    a, b = np.sort(rng.uniform(0.5, 1.0, 2))
    body.inertia = moment * np.array([1.0, b, max(a, 1.0 - b + 1e-3)])
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.03, 0.0, 0.0), contype=1, conaffinity=2)
    return moment


def _strength(model, n, rng) -> np.ndarray:
    """Compute motor torques: twice what gravity and a brisk acceleration need, and what any gear gives, N m."""
    data, M, need = mujoco.MjData(model), np.zeros((n, n)), np.zeros(n)
    for _ in range(50):
        data.qpos[:n] = rng.uniform(model.jnt_range[:n, 0], model.jnt_range[:n, 1])
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, M)
        need = np.maximum(need, np.abs(data.qfrc_bias[:n]) + np.abs(M) @ np.full(n, 5.0))
    return np.maximum(2.0 * need, 10.0 ** rng.uniform(0.0, 1.5, n))


def run(model: mujoco.MjModel, config: cs.ControllerConfig, seed: int, sensor: bool = True) -> Run:
    """Drive one arm through all parts of a run."""
    rng, arm = np.random.default_rng(seed), cs.robots.from_mjcf(model, site="tip")
    data, at, controller = mujoco.MjData(model), arm.bind(model), cs.Controller(arm, config)
    data.qpos[at.qpos] = start = arm.q_min + rng.uniform(0.3, 0.7, arm.n) * (arm.q_max - arm.q_min)
    data.mocap_pos[0] = (0.0, 0.0, 100.0)
    mujoco.mj_forward(model, data)
    controller.reset(start)
    hold = cs.Target(arm.tool_pose(start), STIFFNESS, posture=start)
    target, wrench = hold, np.zeros(6) if sensor else None
    corner = np.where(rng.random(arm.n) < 0.5, arm.q_min, arm.q_max)
    body, push = model.body(f"b{rng.integers(arm.n)}").id, rng.normal(size=3)
    push /= np.linalg.norm(push)
    direction = rng.normal(size=3)
    direction *= 0.2 / np.linalg.norm(direction)
    finite, over, longest, top, energy, most = True, np.zeros(arm.n), 0.0, 0.0, 0.0, 0.0
    for tick in range(LIMITS):
        if RELEASED <= tick < SWEPT:
            target = hold._replace(
                pose=hold.pose._replace(position=hold.pose.position + _done(tick - RELEASED) * direction)
            )
        elif tick >= SWEPT:
            start = data.qpos[at.qpos].copy() if tick == SWEPT else start
            q = start + _done(tick - SWEPT) * (corner - start)
            target = cs.Target(arm.tool_pose(q), STIFFNESS, posture=q)
        data.xfrc_applied[body, :3] = 0.0
        if HELD <= tick < PUSHED:
            force = _pushed(model, data, arm, body, push, controller.record["dynamics"]["M_inv"])
            data.xfrc_applied[body, :3] = force * min((tick - HELD) / 20, 1.0)
        if tick == RELEASED:
            data.mocap_pos[0] = data.site("tip").xpos + 0.5 * direction
        elif tick == SWEPT:
            data.mocap_pos[0] = (0.0, 0.0, 100.0)
        out = controller.step(cs.Measurement(data.qpos[at.qpos], data.qvel[at.dof], wrench), target)
        finite = finite and bool(np.isfinite(out.torque).all())
        data.ctrl[at.ctrl] = out.torque / at.gear
        mujoco.mj_step(model, data, at.steps)
        speed = np.abs(data.qvel[at.dof])
        over = np.where(speed > SPEED_LIMIT, over + 0.001, 0.0)
        inertia = np.diag(controller.record["dynamics"]["M"])
        braking = 0.05 + 2.0 * arm.tau_max.max() / arm.torque_rate_max + (speed - SPEED_LIMIT) * inertia / arm.tau_max
        longest, top = max(longest, float((over / np.maximum(braking, 0.05)).max())), max(top, float(speed.max()))
        gravity = controller.record["dynamics"]["g"]
        energy += 0.001 * float((out.torque - gravity) @ data.qvel[at.dof])
        most = max(most, energy)
        if not top < 1e4:
            longest = np.inf
            break
    return Run(finite, longest, top, most, out.fault)


def _done(ticks: int) -> float:
    """Compute the fraction of a motion of 0.8 s that is done, without a jump of speed."""
    fraction = min(ticks / 800, 1.0)
    return fraction**2 * (3.0 - 2.0 * fraction)


def _pushed(model, data, arm, body: int, direction: np.ndarray, M_inv: np.ndarray) -> np.ndarray:
    """Compute the force of a push in the posture of now: up to 30 N, a third of what the motors can, and no fling."""
    J = np.zeros((3, model.nv))
    mujoco.mj_jacBodyCom(model, data, J, None, body)
    torque = J[:, : arm.n].T @ direction
    flung = np.abs(M_inv @ torque).max()
    strong = np.max(np.abs(torque) / arm.tau_max)
    return direction * min(30.0, PUSH_RAD_S2 / max(flung, 1e-9), 0.3 / max(strong, 1e-9))


def main() -> None:
    """Run the battery and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--arms", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--controllers", default="vices,paper,safe")
    asked = parser.parse_args()
    started = time.monotonic()
    results: dict[str, list[tuple[int, Run]]] = {name: [] for name in asked.controllers.split(",")}
    for seed in range(asked.seed, asked.seed + asked.arms):
        rng = np.random.default_rng(seed)
        model = random_arm(rng, int(rng.integers(3, 11))).compile()
        for name, runs in results.items():
            runs.append((seed, run(model, cs.presets.by_name(name), seed, sensor=seed % 2 == 0)))
            if runs[-1][1].runaway or not runs[-1][1].finite or runs[-1][1].fault != "none":
                print(f"seed {seed}, {name}: {runs[-1][1]}", flush=True)
    heads = f"{'arms':>6s}{'runaways':>10s}{'not finite':>12s}{'faults':>8s}{'speed, largest':>16s}{'energy, p99':>13s}"
    print(f"{'':8s}{heads}")
    for name, runs in results.items():
        only = [found for _, found in runs]
        print(
            f"{name:8s}{len(only):6d}{sum(found.runaway for found in only):10d}"
            f"{sum(not found.finite for found in only):12d}{sum(found.fault != 'none' for found in only):8d}"
            f"{max(found.speed for found in only):10.1f} rad/s{np.percentile([f.energy for f in only], 99):11.0f} J"
        )
    print(f"{time.monotonic() - started:.0f} s")


if __name__ == "__main__":
    main()
