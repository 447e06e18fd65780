"""`InverseKinematics`: finds a posture from anywhere, or says why not."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from contactsafe.core.errors import InvalidInputError, UnreachableError
from contactsafe.robot import ik
from contactsafe.robot.arm import Pose
from contactsafe.robot.ik import InverseKinematics

DOWN = np.array([0.0, 1.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def kinematics(panda):
    return InverseKinematics(panda)


@pytest.fixture(scope="module")
def alone(panda):
    """The compiled solver without TRAC-IK behind it."""
    kinematics = InverseKinematics(panda)
    kinematics._reference = None
    return kinematics


def _found(kinematics, pose):
    try:
        return kinematics.solve(pose)
    except UnreachableError:
        return None


@pytest.mark.parametrize("which", ["kinematics", "alone"])
def test_finds_reachable_poses_from_home(panda, which, request):
    solver, rng = request.getfixturevalue(which), np.random.default_rng(6)
    poses = [panda.tool_pose(q) for q in rng.uniform(panda.q_min, panda.q_max, (500, panda.n))]
    answers = [(pose, q) for pose in poses if (q := _found(solver, pose)) is not None]
    assert len(answers) >= 0.99 * len(poses)
    for pose, q in answers:
        there = panda.tool_pose(q)
        assert_allclose(there.position, pose.position, rtol=0, atol=ik.POSITION_TOLERANCE * 1.001)
        assert abs(there.quat @ pose.quat) > np.cos(ik.ROTATION_TOLERANCE / 2 * 1.001)
        assert np.all((panda.q_min <= q) & (q <= panda.q_max))


def test_trac_ik_answers_where_the_compiled_solver_gives_up(panda, kinematics, alone, monkeypatch):
    monkeypatch.setattr(kinematics, "_reference", ik.trac_ik(panda, timeout_s=1.0))  # by the clock, and others work too
    monkeypatch.setattr(kinematics, "_seeds", [])
    monkeypatch.setattr(alone, "_seeds", [])
    patient = ik.trac_ik(panda, timeout_s=1.0)  # on a busy machine its own 20 ms may pass without it
    if patient is None:
        pytest.skip("pytracik is not installed")
    monkeypatch.setitem(vars(kinematics), "_reference", patient)
    rng = np.random.default_rng(8)
    poses = [panda.tool_pose(q) for q in rng.uniform(panda.q_min, panda.q_max, (100, panda.n))]
    hard = [pose for pose in poses if _found(alone, pose) is None]
    assert hard
    assert sum(_found(kinematics, pose) is not None for pose in hard) > 0.9 * len(hard)


def test_a_near_seed_gives_a_near_answer(panda, kinematics):
    pose = panda.tool_pose(panda.home)
    seed = panda.home + 0.1
    assert np.abs(kinematics.solve(pose, seed) - seed).max() < 0.2
    assert_array_equal(kinematics.solve(pose), kinematics.posture(pose))


def test_either_sign_of_the_quaternion_will_do(panda, kinematics):
    pose = panda.tool_pose(panda.home)
    assert_allclose(kinematics.solve(pose._replace(quat=-pose.quat)), panda.home, rtol=0, atol=1e-12)


def test_a_rounded_quaternion_is_normalised(panda, kinematics):
    pose = panda.tool_pose(panda.home)
    assert_allclose(kinematics.solve(pose._replace(quat=1.0005 * pose.quat)), panda.home, rtol=0, atol=1e-12)


def test_out_of_reach_is_one_clear_line(kinematics):
    with pytest.raises(UnreachableError) as caught:
        kinematics.solve(Pose(np.array([1.5, 0.0, 0.2]), DOWN))
    text = str(caught.value)
    assert text.startswith("pose at [1.500, 0.000, 0.200] m was not reached: the nearest found is ")
    assert text.endswith(" away, allowed is 0.1 mm and 0.01°; move it towards the arm, turn it, or give another q_seed")
    assert "\n" not in text


@pytest.mark.parametrize(
    ("pose", "text"),
    [
        (Pose([0.4, 0.0], DOWN), "pose.position has shape (2,); give 3 finite numbers"),
        (Pose([0.4, 0.0, np.nan], DOWN), "pose.position[2] = nan; every number must be finite"),
        (Pose([0.4, 0.0, 0.4], [0, 0, 1]), "pose.quat has shape (3,); give 4 finite numbers"),
        (
            Pose([0.4, 0.0, 0.4], [0, 2, 0, 0]),
            "pose.quat has length 2; give a unit quaternion w x y z (divide by its length)",
        ),
    ],
)
def test_bad_poses_are_refused(kinematics, pose, text):
    with pytest.raises(InvalidInputError) as caught:
        kinematics.solve(pose)
    assert str(caught.value) == text


def test_bad_seeds_are_refused(panda, kinematics):
    with pytest.raises(InvalidInputError) as caught:
        kinematics.solve(panda.tool_pose(panda.home), [0.0] * 3)
    assert str(caught.value) == "q_seed has shape (3,); give 7 finite numbers"
