"""Whether two versions of the controller command the same torques: closed-loop scenes under the one and the other.

    python benchmarks/same_torques.py --before 93a0d70            200 scenes: what differs, and by how much
    python benchmarks/same_torques.py --before 93a0d70 --scenes 20

A change that is to leave the laws alone is held against the commit before it. Each scene closes a loop of the public
`Controller` around MuJoCo, so a difference in the last bit grows: what counts is its size in the first 100 ms. Scene
and targets come from the scene's number alone; only arm and controller are taken from the version under test.
"""

import argparse
import os
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

import mujoco
import numpy as np

TICKS = 1500
TICKS_PER_ACTION = 17
EARLY_TICKS = 100
ALLOWED_NM = 1e-9  # in the first 100 ms
PRESETS = ("safe", "paper", "vices")
KINDS = ("collision", "push", "wiping", "fuzzed")
OBSTACLE = '<geom type="{}" pos="{}" size="{}" contype="1" conaffinity="2" friction="0.4" solref="0.004 1"/>'


class Scene:
    """One seeded scene: what stands about the arm, what pushes it, and what a policy asks for."""

    def __init__(self, index: int, arm):
        self.rng = np.random.default_rng([20261125, index])
        self.preset, self.kind = PRESETS[index % 3], KINDS[index // 3 % 4]
        self.senses_force = self.rng.random() < 0.7
        spread = 0.5 if self.kind != "wiping" else 0.15
        self.q = np.clip(arm.home + self.rng.uniform(-spread, spread, arm.n), arm.q_min + 0.1, arm.q_max - 0.1)
        self.start = arm.tool_pose(self.q)
        self.goal = self.start.position + self.rng.uniform(-0.3, 0.3, 3)
        self.pushed_link = int(self.rng.integers(2, arm.n + 1))
        self.push_n = self.rng.uniform(-40.0, 40.0, 3)

    def geoms(self) -> str:
        """Write the obstacles as MJCF."""
        if self.kind == "collision":
            places = [self.start.position + f * (self.goal - self.start.position) for f in (0.4, 0.7)]
            return "".join(OBSTACLE.format("sphere", numbers(p + self.rng.uniform(-0.2, 0.2, 3)), 0.06) for p in places)
        if self.kind == "wiping":
            below = self.start.position - (0.0, 0.0, 0.02 + 0.02)
            return OBSTACLE.format("box", numbers(below), "0.6 0.6 0.02")
        return ""

    def ask(self, action: int):
        """Return position, stiffness and damping that the policy asks for with its n-th action."""
        stiffness = self.rng.uniform(30.0, 600.0, 6)
        damping = 2.0 * np.sqrt(stiffness) * self.rng.uniform(0.6, 1.0, 6)
        if self.kind == "fuzzed":
            return self.start.position + self.rng.uniform(-0.6, 0.6, 3), stiffness, damping
        phase = min(action / 40.0, 1.0)
        if self.kind == "wiping":
            circle = 0.08 * np.array([np.sin(6.0 * phase), np.cos(6.0 * phase) - 1.0, 0.0])
            return self.start.position + circle - (0.0, 0.0, 0.05 * min(4.0 * phase, 1.0)), stiffness, damping
        return self.start.position + phase * (self.goal - self.start.position), stiffness, damping


def numbers(values) -> str:
    """Write numbers for MJCF."""
    return " ".join(repr(float(value)) for value in values)


def tool_wrench(model, data, tool: int, point) -> np.ndarray:
    """Sum the forces that contacts exert on the tool's body, about a point, world axes, (6,), N and N m."""
    total, local = np.zeros(6), np.zeros(6)
    for k in range(data.ncon):
        contact = data.contact[k]
        bodies = [model.geom_bodyid[geom] for geom in contact.geom]
        if tool not in bodies:
            continue
        mujoco.mj_contactForce(model, data, k, local)
        sign = 1.0 if bodies[1] == tool else -1.0
        force = sign * contact.frame.reshape(3, 3).T @ local[:3]
        total[:3] += force
        total[3:] += np.cross(contact.pos - point, force)
    return total


def run_scene(index: int, cs, arm, arm_xml: str) -> np.ndarray:
    """Run one scene under the installed version; the torques, (TICKS, n), N m."""
    scene = Scene(index, arm)
    model = mujoco.MjModel.from_xml_string(arm_xml.replace("</worldbody>", scene.geoms() + "</worldbody>"))
    data = mujoco.MjData(model)
    data.qpos[:] = scene.q
    mujoco.mj_forward(model, data)
    controller = cs.Controller(arm, getattr(cs.presets, scene.preset)())
    controller.reset(scene.q)
    tool, site = model.body("tool").id, model.site("tcp").id
    torques = np.zeros((TICKS, arm.n))
    for k in range(TICKS):
        target = None
        if k % TICKS_PER_ACTION == 0:
            position, stiffness, damping = scene.ask(k // TICKS_PER_ACTION)
            target = cs.Target(cs.Pose(position, scene.start.quat), stiffness, damping, scene.q)
        wrench = tool_wrench(model, data, tool, data.site_xpos[site]) if scene.senses_force else None
        output = controller.step(cs.Measurement(data.qpos.copy(), data.qvel.copy(), wrench), target)
        torques[k] = data.ctrl[:] = output.torque
        pushed = scene.kind == "push" and 300 <= k < 900
        data.xfrc_applied[model.body(f"link{scene.pushed_link}").id, :3] = scene.push_n if pushed else 0.0
        mujoco.mj_step(model, data)
    return torques


def run_all(scenes: int, path: str) -> None:
    """Run all scenes under the version on PYTHONPATH and write their torques."""
    import contactsafe as cs
    from contactsafe.robot.mjcf import arm_mjcf

    arm = cs.robots.panda()
    description = getattr(arm, "description", None) or arm.facts  # named so before
    arm_xml = arm_mjcf(description, arm.tool)
    np.save(path, np.array([run_scene(index, cs, arm, arm_xml) for index in range(scenes)]))


def torques_of(source: Path, scenes: int, path: Path) -> np.ndarray:
    """Run all scenes in a process of their own under the package of another source tree."""
    environment = os.environ | {"PYTHONPATH": str(source)}
    command = [sys.executable, __file__, "--scenes", str(scenes), "--into", str(path)]
    subprocess.run(command, check=True, env=environment)
    return np.load(path)


def sources_of(revision: str, folder: Path) -> Path:
    """Unpack a commit's sources."""
    root = Path(__file__).resolve().parents[1]
    archive = subprocess.run(["git", "-C", root, "archive", revision, "src"], check=True, capture_output=True).stdout
    packed = folder / "before.tar"
    packed.write_bytes(archive)
    with tarfile.open(packed) as tar:
        tar.extractall(folder, filter="data")
    return folder / "src"


def report(before: np.ndarray, now: np.ndarray) -> bool:
    """Print what differs; tell whether it is within what is allowed."""
    difference = np.abs(before - now)
    per_scene = difference.reshape(len(difference), -1).max(axis=1)
    early = difference[:, :EARLY_TICKS].max()
    print(f"{len(before)} scenes of {TICKS} ticks, torques up to {np.abs(before).max():.1f} N m")
    print(f"equal to the bit: {(per_scene == 0.0).sum()} scenes")
    print(f"largest difference: {early:.3g} N m in the first {EARLY_TICKS} ticks, {per_scene.max():.3g} N m in all")
    for index in np.flatnonzero(per_scene)[:20]:
        first = int(np.argmax(difference[index].max(axis=1) > 0.0))
        scene = f"scene {index} ({PRESETS[index % 3]}, {KINDS[index // 3 % 4]})"
        print(f"  {scene}: from tick {first}, {per_scene[index]:.3g} N m")
    return bool(early <= ALLOWED_NM)


def main() -> int:
    """Compare two versions."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", default="HEAD", help="commit to compare the working tree with")
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--into", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.into:
        run_all(arguments.scenes, arguments.into)
        return 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        now = torques_of(Path(__file__).resolve().parents[1] / "src", arguments.scenes, folder / "now.npy")
        before = torques_of(sources_of(arguments.before, folder), arguments.scenes, folder / "before.npy")
    return 0 if report(before, now) else 1


if __name__ == "__main__":
    sys.exit(main())
