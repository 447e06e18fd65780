"""The posture of a pose: what it costs, whether it comes back, and where it jumps: docs/concepts/posture.md's figures.

    python benchmarks/posture.py [pairs]

Times are of single calls from Python, arguments ready, and of the thread: waiting for others does not count.
"""

import math
import sys
import time

import numpy as np

from contactsafe import Controller, Measurement, Pose, Target
from contactsafe.core.errors import UnreachableError
from contactsafe.core.rotation import quat_multiply, rotvec_to_quat
from contactsafe.robot import robots
from contactsafe.robot.ik import POSITION_TOLERANCE, ROTATION_TOLERANCE, InverseKinematics
from contactsafe.robot.posture import find_posture, posture_rule

DOWN = np.array([0.0, 1.0, 0.0, 0.0])
CALLS, PAIRS = 5000, 100_000
LAPS, PLACES, POINTS = 100, 10, 12
PLANES = ((0, 1), (0, 2), (1, 2))
STIFFNESS = np.full(6, 150.0)


def over_the_table(rng, arm, tilt=0.2, yaw=1.5):
    """Draw a pose as tasks on a table have it: before the arm, the tool down, a little tilted, turned about."""
    position = rng.uniform([0.35, -0.35, 0.02], [0.65, 0.35, 0.5])
    return Pose(
        position, quat_multiply(rotvec_to_quat(np.array([*rng.uniform(-tilt, tilt, 2), 0.0])), turned(rng, yaw))
    )


def turned(rng, yaw):
    """Draw an orientation straight down, turned about the vertical."""
    return quat_multiply(rotvec_to_quat(np.array([0.0, 0.0, rng.uniform(-yaw, yaw)])), DOWN)


def steep(rng, arm):
    """Draw a pose with the tool tilted by up to 40° and more, near the base as well."""
    position = rng.uniform([0.3, -0.4, 0.02], [0.65, 0.4, 0.6])
    return Pose(position, quat_multiply(rotvec_to_quat(rng.uniform(-0.4, 0.4, 3)), DOWN))


def anywhere(rng, arm):
    """Draw what some posture within the joint range reaches."""
    return arm.tool_pose(rng.uniform(arm.q_min, arm.q_max))


def just_out_of_reach(rng, arm):
    """Draw a pose over the table's far edge."""
    return Pose(np.array([rng.uniform(0.75, 0.95), rng.uniform(-0.3, 0.3), rng.uniform(0.1, 0.5)]), DOWN)


def far_out_of_reach(rng, arm):
    """Draw a pose metres away."""
    return Pose(rng.uniform(1.5, 100.0, 3), DOWN)


def find(rule, pose, q):
    """Find a posture; give whether there is one, and the time it took, µs."""
    start = time.thread_time()
    error, turn = find_posture(rule, pose.position, pose.quat, q)
    return error <= POSITION_TOLERANCE and turn <= ROTATION_TOLERANCE, 1e6 * (time.thread_time() - start)


def measure_time(arm):
    """Print what a call costs."""
    rule, rng, q = posture_rule(arm), np.random.default_rng(0), np.empty(arm.n)
    find(rule, over_the_table(rng, arm), q)
    for draw in (over_the_table, anywhere, just_out_of_reach, far_out_of_reach):
        found = np.array([find(rule, draw(rng, arm), q) for _ in range(CALLS)])
        for reached, word in ((1.0, "reached"), (0.0, "refused")):
            took = found[found[:, 0] == reached, 1]
            if len(took) >= 10:
                middle, high, most = np.percentile(took, [50, 99, 99.9])
                words = f"median {middle:5.1f}, 99 % {high:5.1f}, 99.9 % {most:5.1f} µs"
                print(f"{arm.name:5} {draw.__name__:17} {word} {len(took) / CALLS:7.2%}: {words}")


def measure_step(arm):
    """Print what a whole tick from Python costs with a new target, one that is reached and one that is not."""
    controller, measurement, rng = Controller(arm), Measurement(arm.home, np.zeros(arm.n)), np.random.default_rng(1)
    controller.reset(arm.home)
    for draw in (over_the_table, just_out_of_reach, far_out_of_reach):
        took = []
        for _ in range(CALLS):
            target, start = Target(draw(rng, arm), STIFFNESS), time.thread_time()
            try:
                controller.step(measurement, target)
                refused = False
            except UnreachableError:
                refused = True
            if refused == (draw is not over_the_table):
                took.append(1e6 * (time.thread_time() - start))
        middle, most = np.percentile(took, [50, 99.9])
        print(f"{arm.name:5} Controller.step, {draw.__name__:17}: median {middle:5.1f}, 99.9 % {most:5.1f} µs")


def measure_laps(arm):
    """Print how far the posture is from where it was after many laps, and its largest change from point to point."""
    controller, kinematics, rng = Controller(arm), InverseKinematics(arm), np.random.default_rng(2)
    controller.reset(arm.home)

    def by_controller(pose):
        controller.set_target(Target(pose, STIFFNESS))
        return controller.record["target"]["q_posture"].copy()

    drifts, unreached = {"InverseKinematics": [], "Controller": []}, 0
    for _ in range(PLACES):
        centre = rng.uniform([0.4, -0.3, 0.2], [0.55, 0.3, 0.45])
        for radius in (0.05, 0.1, 0.2):
            for plane in PLANES:
                try:
                    lap = [at(centre, radius, plane, k / POINTS) for k in range(POINTS)]
                    for name, ask in (("InverseKinematics", kinematics.posture), ("Controller", by_controller)):
                        first = ask(lap[0])
                        for pose in LAPS * lap:
                            ask(pose)
                        drifts[name].append(np.abs(ask(lap[0]) - first).max())
                except UnreachableError:
                    unreached += 1
    for name, drift in drifts.items():
        words = f"largest drift {1e3 * max(drift):.3g} mrad; {unreached} circles leave the reach"
        print(f"{arm.name:5} {name}: {len(drift)} circles, {LAPS} laps each: {words}")


def at(centre, radius, plane, part):
    """Give the pose at a part of a lap, 0 … 1."""
    position = centre.copy()
    position[list(plane)] += radius * np.array([math.cos(2.0 * math.pi * part), math.sin(2.0 * math.pi * part)])
    return Pose(position, DOWN)


def measure_jumps(arm, pairs):
    """Print by how much postures of poses 1 mm apart differ."""
    rule, rng, q, aside = posture_rule(arm), np.random.default_rng(3), np.empty(arm.n), np.empty(arm.n)
    for draw in (over_the_table, steep, anywhere):
        jumps = []
        for _ in range(pairs):
            pose, step = draw(rng, arm), rng.normal(size=3)
            beside = pose._replace(position=pose.position + 1e-3 * step / np.linalg.norm(step))
            if find(rule, pose, q)[0] and find(rule, beside, aside)[0]:
                jumps.append(np.abs(q - aside).max())
        middle, high, most = np.percentile(jumps, [50, 99.9, 100])
        shares = ", ".join(f"{(np.array(jumps) > bound).mean():.3%} over {bound}" for bound in (0.05, 0.3))
        words = f"median {1e3 * middle:.1f}, 99.9 % {1e3 * high:.0f}, most {1e3 * most:.0f} mrad; {shares} rad"
        print(f"{arm.name:5} {draw.__name__:15} {len(jumps)} of {pairs} pairs 1 mm apart reached: {words}")


def main():
    """Measure and print."""
    pairs = int(sys.argv[1]) if len(sys.argv) > 1 else PAIRS
    for arm in (robots.panda(), robots.fr3()):
        measure_time(arm)
        measure_step(arm)
        measure_laps(arm)
        measure_jumps(arm, pairs)


if __name__ == "__main__":
    main()
