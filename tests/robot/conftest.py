"""Arms and states that the tests of this room share."""

import math

import numpy as np
import pytest

from contactsafe.robot import robots
from contactsafe.robot.arm import arm_from_description
from contactsafe.robot.description import ArmDescription, Capsule, Inertia, Joint, Link, Tip, Tool


@pytest.fixture(scope="session")
def panda():
    return robots.panda()


@pytest.fixture(scope="session")
def fr3():
    return robots.fr3()


@pytest.fixture(scope="session")
def random_arms():
    """Arms that obey no designer: every frame turned, every inertia skew."""
    rng = np.random.default_rng(2)
    return [_random_arm(rng, n) for n in (2, 6, 7)]  # each n compiles anew


@pytest.fixture(scope="session")
def arms(panda, fr3, random_arms):
    return [panda, fr3, *random_arms]


@pytest.fixture(scope="session")
def states(arms):
    """Arm, q and qd, twenty of each arm."""
    rng = np.random.default_rng(3)
    return [(arm, rng.uniform(arm.q_min, arm.q_max), rng.uniform(-2, 2, arm.n)) for arm in arms for _ in range(20)]


def _random_arm(rng, n):
    description = ArmDescription(
        name=f"random{n}",
        source="random",
        base=_random_inertia(rng),
        base_capsules=(),
        links=tuple(
            Link(
                position=_tuple(rng.uniform(-0.4, 0.4, 3)),
                quat=_random_quat(rng),
                inertia=_random_inertia(rng),
                joint=Joint(-2.5, 2.5, 2.0, 50.0, (0.5, 8.0, 0.02), float(rng.uniform(0.0, 0.2))),
                capsules=(Capsule(_tuple(rng.uniform(-0.1, 0.1, 3)), _tuple(rng.uniform(-0.1, 0.1, 3)), 0.05),),
            )
            for _ in range(n)
        ),
        mount_position=_tuple(rng.uniform(-0.2, 0.2, 3)),
        mount_quat=_random_quat(rng),
        torque_rate_max=1000.0,
        home=(0.3,) * n,
    )
    tool = Tool("random", _random_inertia(rng), _tuple(rng.uniform(-0.2, 0.2, 3)), (), Tip((0.03, 0.02, 0.01)))
    return arm_from_description(description, tool)


def _random_inertia(rng):
    """Return the inertia of a cloud of points: whatever they are, such a body can exist."""
    points = rng.normal(size=(8, 3)) * 0.08
    points -= points.mean(axis=0)
    mass = float(rng.uniform(0.5, 4.0))
    I = mass / len(points) * sum(p @ p * np.eye(3) - np.outer(p, p) for p in points)  # noqa: E741
    return Inertia(mass, _tuple(rng.uniform(-0.1, 0.1, 3)), _tuple((*np.diag(I), I[0, 1], I[0, 2], I[1, 2])))


def _random_quat(rng):
    quat = rng.normal(size=4)
    return _tuple(quat / math.sqrt(quat @ quat))


def _tuple(values):
    return tuple(float(value) for value in values)
