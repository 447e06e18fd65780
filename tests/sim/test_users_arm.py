"""Worlds around an arm that came as MJCF: its gravity, its wrist sensor, its pictures, the second engine."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.robot.worlds import SIX

from contactsafe.core.errors import InvalidInputError
from contactsafe.report.scene import View, picture
from contactsafe.results.recording import Recording, Stage
from contactsafe.robot import robots
from contactsafe.sim.config import NO_NOISE, PlantConfig, WorldConfig
from contactsafe.sim.scene import build_plant
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import MAX_TICKS, Worlds


def six(xml=SIX, **options):
    tip = robots.Tip((0.03, 0.03, 0.01))
    return robots.from_mjcf(mujoco.MjModel.from_xml_string(xml), site="tip", **{"tip": tip} | options)


def rest(arm, config=None, ticks=300, backend=None):
    """Hold an arm where home is; return worlds and trace."""
    worlds = Worlds(arm, config or WorldConfig(sensors=NO_NOISE), backend=backend)
    worlds.reset(0, arm.home)
    pose = arm.tool_pose(arm.home)
    target = worlds.controllers[0]["target"]
    target["position"], target["quat"], target["q_posture"] = pose.position, pose.quat, arm.home
    target["K_task"] = [150.0] * 3 + [450.0] * 3
    target["D_task"] = 2.0 * np.sqrt(target["K_task"])
    trace = np.zeros((1, ticks // MAX_TICKS * MAX_TICKS), dtype=trace_dtype(arm.n))
    for k in range(0, trace.shape[1], MAX_TICKS):
        worlds.run(MAX_TICKS, piece := np.zeros((1, MAX_TICKS), dtype=trace.dtype))
        trace[:, k : k + MAX_TICKS] = piece
    return worlds, trace[0]


@pytest.mark.parametrize("gravity", ["0 0 -9.81", "1 2 -9", "0 0 0"])
def test_an_arm_rests_under_the_gravity_of_its_scene(gravity):
    arm = six(SIX.replace('timestep="0.001"', f'timestep="0.001" gravity="{gravity}"'))
    worlds, trace = rest(arm)
    assert_allclose(trace["q"][-1], arm.home, rtol=0, atol=2e-4)
    assert_allclose(trace["wrench_ee"][-1], 0.0, atol=0.02)
    assert not trace["mode"].any()
    worlds.close()


def test_both_engines_hold_it_alike():
    pytest.importorskip("pybullet")
    from contactsafe.sim.bullet_backend import BulletBackend

    for arm in (six(), six(SIX.replace('<joint name="wrist3"', '<joint name="wrist3" armature="0"'))):
        worlds, trace = rest(arm, backend=BulletBackend)
        assert_allclose(trace["q"][-1], arm.home, rtol=0, atol=1e-3)
        assert not trace["mode"].any()
        worlds.close()


def test_errors_of_the_plant_are_those_of_a_described_arm():
    arm = six()
    nominal = build_plant(arm, WorldConfig())
    heavier = build_plant(arm, WorldConfig(plant=PlantConfig(inertia_scale=1.2, payload_kg=0.5)))
    links = [nominal.body(f"link{i}").id for i in range(1, 7)]
    assert_allclose(heavier.body_mass[links], 1.2 * nominal.body_mass[links], rtol=1e-9)
    assert_allclose(heavier.body("tool").mass, 0.5, rtol=1e-9)


def test_it_is_drawn():
    arm = six()
    trace = np.zeros(10, dtype=trace_dtype(arm.n))
    trace["q"] = arm.home
    corners = ((0.2, -0.2, 0.0), (0.6, -0.2, 0.0), (0.6, 0.2, 0.0), (0.2, 0.2, 0.0))
    stage = Stage(arm.description, arm.tool, np.array(corners), {})
    recording = Recording("held", "safe", 0, trace)
    svg = picture(stage, View((0.3, 0.0, 0.5), (1.5, 1.5)), recording, 0, 300, 300)
    assert svg.count('class="arm"') == len(arm.description.base_capsules) + sum(
        len(link.capsules) for link in arm.description.links
    )


def test_an_arm_nobody_described_is_refused():
    with pytest.raises(InvalidInputError) as caught:
        Worlds(replace(six(), description=None))
    assert str(caught.value) == (
        "arm 'own scene' has no description of its links and tool; give contactsafe.robots.panda(), or one of "
        "robots.from_mjcf"
    )


def test_friction_of_a_tip_that_is_not_there_is_refused():
    worlds = Worlds(six(tip=None))
    with pytest.raises(InvalidInputError) as caught:
        worlds.set_tip_friction(0, 0.4)
    assert str(caught.value) == (
        "arm 'own scene' has no tip to work with; give it a tool that has, or robots.from_mjcf(..., "
        "tip=robots.Tip(...))"
    )
    worlds.close()
