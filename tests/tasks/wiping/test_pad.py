"""The felt pad: how stiff it is under a press, as `TipSurface` states it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.sim.scenes import BOARD_Z, aim, run, worlds_at

CORNER_N_PER_M = 4800.0


@pytest.mark.parametrize("place", [(0.5, 0.0), (0.4, 0.1), (0.6, -0.1)])
def test_each_corner_that_touches_is_a_spring_of_4_8_kn_per_m(place):
    """The arm's inertia, its posture and the press do not matter; a tilted pad stands on fewer corners."""
    worlds = worlds_at((*place, BOARD_Z + 0.0005))
    for depth in (0.002, 0.005, 0.01):
        aim(worlds, (*place, BOARD_Z - depth))
        force = run(worlds, 1200)[0]["tool_force"][-1, 2]
        data = worlds.datas[0]
        sunk = np.array([-contact.dist for contact in data.contact[: data.ncon]])
        assert force > 1.0
        assert 2 <= len(sunk) <= 4
        assert_allclose(force / sunk.sum(), CORNER_N_PER_M, rtol=0.04)


def test_a_press_tilts_the_pad_little():
    """Λ couples the axes: at 10 N the pad stands within a degree of flat."""
    worlds = worlds_at((0.5, 0.0, BOARD_Z + 0.0005))
    aim(worlds, (0.5, 0.0, BOARD_Z - 0.008), stiffness=np.array([150.0] * 3 + [450.0] * 3))
    force = run(worlds, 1500)[0]["tool_force"][-1, 2]
    assert 8.0 < force < 13.0
    tilt = np.degrees(np.arccos(-worlds.controllers[0]["output"]["rotation"][2, 2]))
    assert tilt < 1.0
