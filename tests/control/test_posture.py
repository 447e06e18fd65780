"""The posture that the controller gives a target without one."""

import math

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from tests.control.plant import controller_at, hold, reach

from contactsafe import Measurement, Pose, presets
from contactsafe.core.errors import UnreachableError


def test_twenty_laps_without_a_posture_bring_the_elbow_back(panda):
    controller, home = controller_at(panda, presets.safe()), hold(panda)
    for plane in ((0, 1), (0, 2), (1, 2)):
        for lap in range(20):
            for angle in np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False):
                offset = np.zeros(3)
                offset[list(plane)] = 0.1 * np.array([math.cos(angle) - 1.0, math.sin(angle)])
                controller.set_target(reach(panda, offset)._replace(posture=None))
                if lap == 0 and angle == 0.0:
                    first = controller.record["target"]["q_posture"].copy()
        controller.set_target(home._replace(posture=None))
        assert np.abs(controller.record["target"]["q_posture"] - first).max() < 1e-3


def test_where_the_arm_stands_has_no_say(panda):
    """The posture is the pose's, also for an arm that was reset with its elbow elsewhere."""
    target, found = reach(panda, [0.05, 0.1, -0.05])._replace(posture=None), []
    for aside in (0.0, 0.5):
        controller = controller_at(panda, presets.safe())
        controller.reset(panda.home + aside)
        controller.set_target(target)
        found.append(controller.record["target"]["q_posture"].copy())
    assert_array_equal(*found)


def test_a_streamed_target_out_of_reach_is_refused_and_the_last_good_one_holds(panda, monkeypatch):
    controller = controller_at(panda, presets.safe())
    monkeypatch.setattr(controller._ik, "solve", None)  # the thorough search takes 21 ms
    measurement, start = Measurement(panda.home, np.zeros(7)), hold(panda)._replace(posture=None)
    good = 0
    for x in np.linspace(0.3, 1.3, 101):
        target = start._replace(pose=Pose(np.array([x, 0.0, 0.46]), start.pose.quat))
        before = controller.record["target"].copy()
        try:
            controller.step(measurement, target)
            good += 1
        except UnreachableError:
            assert controller.record["target"] == before
    assert 20 < good < 60
    with pytest.raises(UnreachableError):
        controller.step(measurement, target)
