"""Inverse kinematics: the compiled solver against TRAC-IK, on the same poses and seeds in one run.

TRAC-IK runs two solvers in two threads and takes the first answer: its time depends on how busy the machine is.

Run: python benchmarks/ik.py
"""

import time

import numpy as np

from contactsafe.core.rotation import quat_to_matrix
from contactsafe.robot import robots
from contactsafe.robot.ik import solve_ik, trac_ik

POSES = 500
REPEATS = 5


def main():
    arm = robots.panda()
    nominal, reference, rng = arm.nominal(), trac_ik(arm), np.random.default_rng(0)
    q_there = rng.uniform(arm.q_min, arm.q_max, (POSES, arm.n))
    poses = [arm.tool_pose(q) for q in q_there]
    rotations = [quat_to_matrix(pose.quat) for pose in poses]
    q = np.zeros(arm.n)

    def compiled(index, seed):
        solve_ik(nominal.handle, *poses[index], seed, arm.q_min, arm.q_max, q)
        return q

    def trac(index, seed):
        return reference.ik(poses[index].position, rotations[index], seed)

    solvers = {"compiled": compiled} | ({"TRAC-IK": trac} if reference is not None else {})
    print(f"{arm.name}, {POSES} poses anywhere within the limits; called from Python, best of {REPEATS} calls each")
    for spread in (0.02, 0.1):
        seeds = np.clip(q_there + rng.uniform(-spread, spread, q_there.shape), arm.q_min, arm.q_max)
        medians = {}
        for name, solver in solvers.items():
            seconds, errors = zip(*(measure(arm, solver, i, seeds[i], poses[i]) for i in range(POSES)), strict=True)
            medians[name] = np.median(seconds)
            reached = sum(error < 1e-3 for error in errors)
            words = f"median {1e6 * medians[name]:6.1f} µs, {reached}/{POSES} within 1 mm"
            print(f"seed within {spread} rad: {name:8} {words}")
        if len(medians) == 2:
            print(f"seed within {spread} rad: TRAC-IK / compiled = {medians['TRAC-IK'] / medians['compiled']:.1f}")


def measure(arm, solver, index, seed, pose):
    """Time one solver on one pose, s, and give the position error of its answer, m."""
    best, answer = np.inf, None
    for _ in range(REPEATS):
        start = time.perf_counter()
        answer = solver(index, seed)
        best = min(best, time.perf_counter() - start)
    return best, np.inf if answer is None else np.linalg.norm(arm.tool_pose(answer).position - pose.position)


if __name__ == "__main__":
    main()
