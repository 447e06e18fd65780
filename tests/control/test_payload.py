"""What the tool carries is identified at rest, taken over without a jump, and never sinks in silence."""

import copy
import pickle
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from tests.control.plant import UNTOUCHED, Plant, controller_at, hold, reach

from contactsafe import Controller, Measurement, Pose, presets
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.mjcf import arm_mjcf
from contactsafe.robot.payload import Payload, carrying

BARE = {name: presets.by_name(name).with_(friction_compensation=False) for name in presets.PRESETS}
SAFE = BARE["safe"]
COM = np.array([0.03, -0.02, 0.05])
INERTIA = np.diag([0.01, 0.012, 0.008])


class Loaded(Plant):
    """An arm whose tool carries a load; it may have a sensor in the wrist that shows it."""

    def __init__(self, arm, kg, com=COM, q=None):
        self.load = Payload(kg, np.array(com), INERTIA)
        super().__init__(arm, q, carrying(arm, self.load).model)

    def in_the_wrist(self):
        """Give what a sensor between arm and load shows at rest and in motion, (6,), N and N m."""
        site = self.model.site(self.arm.site).id
        a, v, R = np.zeros(6), np.zeros(6), self.data.site_xmat[site].reshape(3, 3)
        mujoco.mj_rnePostConstraint(self.model, self.data)
        mujoco.mj_objectAcceleration(self.model, self.data, mujoco.mjtObj.mjOBJ_SITE, site, a, 0)
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_SITE, site, v, 0)
        r, spin, tensor = R @ self.load.com, v[:3], R @ self.load.inertia @ R.T
        force = -self.load.mass * (a[3:] + np.cross(a[:3], r) + np.cross(spin, np.cross(spin, r)))
        return np.r_[force, np.cross(r, force) - tensor @ a[:3] - np.cross(spin, tensor @ spin)]


def wrench_of(plant, sensor):
    """Give what no sensor, one that shows contact alone, and one in the wrist that was told nothing say."""
    return plant.in_the_wrist() if sensor == "wrist" else {"none": None, "contact only": UNTOUCHED}[sensor]


def settle(plant, controller, target, ticks, sensor="none"):
    outs = []
    for _ in range(ticks):
        outs.append(controller.step(Measurement(plant.q, plant.qd, wrench_of(plant, sensor)), target))
        plant.step(outs[-1].torque)
    return outs


def largest_step(outs):
    return np.abs(np.diff([out.torque for out in outs], axis=0)).max()


def test_dry_friction_that_was_identified_may_hold_as_much_as_the_published(panda):
    """What holds an arm that is to rise by 10 mm and does not: 2 N m of friction, whatever column it stands in."""

    def identified(phi1, dry):
        arm = replace(panda, friction=np.tile((phi1, 12.0, 0.0), (7, 1)), drag=np.tile((0.0, 0.0, dry), (7, 1)))
        controller = controller_at(arm, SAFE)
        for _ in range(800):
            controller.step(Measurement(arm.home, np.zeros(7)), reach(arm, (0.0, 0.0, 0.01)))
        return controller.record["state"]["payload"].copy()

    nothing, published, dry = identified(0.0, 0.0), identified(2.0, 0.0), identified(0.0, 2.0)
    assert dry.tobytes() == published.tobytes()
    assert dry["covariance"][0, 0] > 5.0 * nothing["covariance"][0, 0]


@pytest.mark.parametrize("sensor", ["none", "contact only", "wrist"])
@pytest.mark.parametrize("preset", presets.PRESETS)
def test_a_load_never_sinks_in_silence(panda, preset, sensor):
    """Up to the 3 kg that a Panda is rated for: the tool is off by less than 10 mm, or the fault names the load."""
    for kg in (0.5, 3.0):
        plant, controller = Loaded(panda, kg), controller_at(panda, BARE[preset])
        out = settle(plant, controller, hold(panda), 3000, sensor)[-1]
        assert np.linalg.norm(out.error[:3]) < 0.01 or "load" in out.fault


def test_a_load_that_scales_the_task_down_is_named(panda):
    """It weighs more than what a push is resisted with."""
    plant, controller = Loaded(panda, 7.0), controller_at(panda, SAFE)
    out = settle(plant, controller, hold(panda), 1500)[-1]
    assert {"tool force", "load"} <= set(out.limited_by)


def test_a_load_is_named_while_it_falls(panda):
    """So soft a tool falls faster than an arm at rest moves."""
    plant, controller = Loaded(panda, 3.0), controller_at(panda, SAFE)
    out = settle(plant, controller, hold(panda)._replace(stiffness=np.full(6, 10.0)), 2500)[-1]
    assert "load" in out.fault


@pytest.mark.parametrize("sensor", ["none", "contact only", "wrist"])
def test_what_the_tool_carries_is_weighed(panda, sensor):
    """One posture does not tell how far along the weight's line the centre is: that line is compared."""
    for kg in (0.5, 2.0):
        plant, controller = Loaded(panda, kg), controller_at(panda, SAFE)
        settle(plant, controller, hold(panda), 1500, sensor)
        found = controller.payload_estimate()
        down = plant.data.site(panda.site).xmat.reshape(3, 3).T @ np.array([0.0, 0.0, -1.0])
        assert abs(found.mass - kg) < 0.05
        assert np.linalg.norm(np.cross(found.com - COM, down)) < 0.01


def test_two_postures_tell_where_the_load_is(panda):
    plant, controller = Loaded(panda, 2.0), controller_at(panda, SAFE)
    pose = panda.tool_pose(panda.home)
    turned = Pose(pose.position, np.array([0.0, 0.924, 0.0, 0.383]) / np.hypot(0.924, 0.383))
    for target in (hold(panda), hold(panda)._replace(pose=turned, posture=None)):
        settle(plant, controller, target, 2500)
    np.testing.assert_allclose(controller.payload_estimate().com, COM, atol=0.015)


@pytest.mark.parametrize("sensor", ["none", "contact only", "wrist"])
def test_set_payload_makes_no_jump_and_no_contact(panda, sensor):
    plant, controller = Loaded(panda, 2.0), controller_at(panda, SAFE)
    outs = settle(plant, controller, hold(panda), 1500, sensor)
    found = controller.payload_estimate()
    controller.set_payload(found.mass, found.com)
    outs += settle(plant, controller, hold(panda), 4000, sensor)
    assert largest_step(outs) <= 1.0
    assert not any(out.contact.in_contact for out in outs[1600:])
    assert np.linalg.norm(outs[-1].error[:3]) < 0.002
    assert outs[-1].fault == "none"
    assert controller.payload_estimate() is None


def test_a_load_taken_up_as_it_is_told_hardly_moves_the_tool(panda):
    """The same tick brings the load and the word of it: only the torque rate lets the tool sink."""
    controller, bare, loaded = controller_at(panda, SAFE), Plant(panda), Loaded(panda, 3.0)
    settle(bare, controller, hold(panda), 300)
    loaded.data.qpos[:], loaded.data.qvel[:] = bare.q, bare.qd
    controller.set_payload(3.0, COM, INERTIA)
    outs = settle(loaded, controller, hold(panda), 1000)
    assert max(np.linalg.norm(out.error[:3]) for out in outs) < 0.004
    assert not any(out.contact.in_contact for out in outs)


@pytest.mark.parametrize("sensor", ["none", "contact only", "wrist"])
def test_a_known_load_is_no_contact_in_motion(panda, sensor):
    plant, controller = Loaded(panda, 3.0), Controller(panda, SAFE)
    controller.set_payload(3.0, COM, INERTIA, in_wrench=sensor == "wrist")
    controller.reset(panda.home)
    home = panda.tool_pose(panda.home)
    for k in range(1500):
        offset = 0.1 * np.sin(np.array([k / 150, k / 230, k / 190]))
        target = hold(panda)._replace(pose=Pose(home.position + offset, home.quat), stiffness=np.full(6, 400.0))
        out = controller.step(Measurement(plant.q, plant.qd, wrench_of(plant, sensor)), target)
        plant.step(out.torque)
        assert not out.contact.in_contact
        assert "tool force" not in out.limited_by


@pytest.mark.parametrize("every", [2, 10])
def test_a_known_load_was_a_contact_where_the_force_sensor_is_slower_than_the_loop(panda, every):
    plant, controller = Loaded(panda, 3.0), Controller(panda, SAFE)
    controller.set_payload(3.0, COM, INERTIA, in_wrench=True)
    controller.reset(panda.home)
    home = panda.tool_pose(panda.home)
    for k in range(1500):
        offset = 0.05 * np.sin(np.array([k / 150, k / 230, k / 190]))
        target = hold(panda)._replace(pose=Pose(home.position + offset, home.quat))
        wrench = plant.in_the_wrist() if k % every == 0 else None
        out = controller.step(Measurement(plant.q, plant.qd, wrench), target)
        plant.step(out.torque)
        assert not out.contact.in_contact


def test_a_load_told_while_measurements_are_missing_is_no_contact(panda):
    plant, controller = Loaded(panda, 2.0), controller_at(panda, SAFE)
    settle(plant, controller, hold(panda), 1000, "contact only")
    blind = Measurement(np.full(7, np.nan), np.full(7, np.nan), UNTOUCHED)
    for k in range(10):
        if k == 5:
            controller.set_payload(2.0, COM, INERTIA)
        plant.step(controller.step(blind, hold(panda)).torque)
    outs = settle(plant, controller, hold(panda), 300, "contact only")
    assert max(np.abs(out.residual).max() for out in outs[100:]) < 0.5


def test_what_a_sensor_showed_before_a_reset_has_no_say(panda):
    controller = controller_at(panda, SAFE)
    controller.step(Measurement(panda.home, np.zeros(7), np.array([0.0, 0.0, -30.0, 0.0, 0.0, 0.0])), hold(panda))
    controller.reset(panda.home)
    controller.set_payload(2.0)
    assert controller.record["payload"]["in_wrench"] == 0


def test_an_estimate_is_the_callers_to_change(panda):
    plant, controller = Plant(panda), Controller(panda, SAFE)
    controller.set_payload(1.0)
    controller.reset(panda.home)
    settle(plant, controller, hold(panda), 1500)
    controller.payload_estimate().com[0] = 7.0
    assert controller.payload_estimate().com[0] == 0.0


def test_a_push_sideways_or_from_below_is_no_load(panda):
    for force in ((25.0, 0.0, 0.0), (0.0, 25.0, 0.0), (0.0, 0.0, 25.0)):
        plant, controller = Plant(panda), controller_at(panda, SAFE)
        plant.push("tool", force)
        outs = settle(plant, controller, hold(panda), 2500)
        assert controller.payload_estimate() is None
        assert "load" not in outs[-1].fault
        assert not any("load" in out.limited_by for out in outs)


def test_an_empty_tool_carries_nothing(panda):
    plant, controller = Plant(panda), controller_at(panda, SAFE)
    settle(plant, controller, hold(panda), 1000)
    assert controller.payload_estimate() is None
    assert controller.payload.mass == 0.0


def test_a_load_that_is_no_longer_there_is_named(panda):
    plant, controller = Plant(panda), Controller(panda, SAFE)
    controller.set_payload(2.0)
    controller.reset(panda.home)
    out = settle(plant, controller, hold(panda), 2500)[-1]
    assert "load" in out.fault
    assert not out.braked


def test_a_fault_that_is_over_hid_the_load(panda):
    plant, controller = Loaded(panda, 3.0), controller_at(panda, SAFE)
    controller.step(Measurement(np.full(7, np.nan), np.zeros(7)), hold(panda))
    assert "load" in settle(plant, controller, hold(panda), 2500)[-1].fault


def test_a_load_put_down_is_weighed_as_nothing(panda):
    plant, controller = Plant(panda), Controller(panda, SAFE)
    controller.set_payload(1.0)
    controller.reset(panda.home)
    settle(plant, controller, hold(panda), 1500)
    assert controller.payload_estimate().mass < 0.05


def test_a_load_outlives_a_reset_and_is_copied_along(panda):
    controller = controller_at(panda, SAFE)
    controller.set_payload(1.5, COM)
    controller.reset(panda.home)
    copies = controller, copy.deepcopy(controller), pickle.loads(pickle.dumps(controller))
    for _ in range(20):
        torques = [each.step(Measurement(panda.home, np.zeros(7)), hold(panda)).torque for each in copies]
    np.testing.assert_array_equal(torques[1], torques[0])
    np.testing.assert_array_equal(torques[2], torques[0])
    loaded = carrying(panda, Payload(1.5, COM, np.zeros((3, 3))))
    np.testing.assert_allclose(torques[0], loaded.dynamics(panda.home, np.zeros(7))["g"], atol=1e-6)
    controller.set_payload(0.0)
    assert copies[1].payload.mass == 1.5


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ((np.nan,), "mass"),
        ((-1.0,), "kg ≥ 0"),
        (("heavy",), "mass"),
        ((1.0, [0.0, 0.0]), "com"),
        ((1.0, [0.0, np.inf, 0.0]), "com"),
        ((1.0, None, -np.eye(3)), "moments"),
        ((1.0, None, np.diag([1.0, 0.1, 0.1])), "moments"),
        ((1.0, None, np.triu(np.ones((3, 3)))), "symmetric"),
        ((0.0, None, np.eye(3)), "mass is 0"),
        ((1.0, None, 2.0 * np.eye(3)), "within 1 m"),
        ((1.0, [1.5, 0.0, 0.0]), "tool point"),
        ((50.0,), "N m of joint"),
        ((2.0, [0.7, 0.0, 0.7]), "N m of joint"),
        ((1.0, None, None, "no"), "in_wrench"),
        ((1.0, None, None, np.array([True, False])), "in_wrench"),
    ],
)
def test_what_no_tool_carries_is_refused_and_nothing_changes(panda, given, told):
    controller = controller_at(panda, SAFE)
    controller.set_payload(3.0)
    before = controller.record.copy()
    with pytest.raises(InvalidInputError, match=told) as refused:
        controller.set_payload(*given)
    assert "\n" not in str(refused.value)
    assert controller.record.tobytes() == before.tobytes()


def test_a_load_joins_the_tool_as_mujoco_would_weld_it(panda):
    """Inertia, gravity and bias of the joined body are those of two bodies welded together."""
    spec = mujoco.MjSpec.from_string(arm_mjcf(panda.description, panda.tool))
    body = spec.body("tool").add_body(name="load", pos=panda.model.site("tcp").pos)
    body.mass, body.ipos, body.inertia, body.explicitinertial = 1.2, COM, np.diag(INERTIA), True
    welded = mujoco.MjData(spec.compile())
    joined = carrying(panda, Payload(1.2, COM, INERTIA))
    rng = np.random.default_rng(0)
    q, qd = rng.uniform(panda.q_min, panda.q_max), rng.normal(size=7)
    welded.qpos[:], welded.qvel[:] = q, qd
    mujoco.mj_forward(welded.model, welded)
    M = np.zeros((7, 7))
    mujoco.mj_fullM(welded.model, welded, M)
    ours = joined.dynamics(q, qd)
    np.testing.assert_allclose(ours["M"], M, atol=1e-9)
    np.testing.assert_allclose(ours["c"] + ours["g"], welded.qfrc_bias, atol=1e-8)
