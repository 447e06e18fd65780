"""A sensor under the base tells the wrench of all contacts together, at rest and in motion, and joins the evidence."""

from itertools import pairwise

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.control.plant import UNTOUCHED, Plant, controller_at, hold

from contactsafe import ContactEstimator, Measurement, presets, robots
from contactsafe.control.codes import BAD_BASE, FAULTS
from contactsafe.core.errors import InvalidInputError

ARM = robots.panda("hand")
FORCE = np.array([6.0, 24.0, -9.0])
OFF = np.array([3.0, -4.0, -25.0, 1.0, 0.5, -0.2])
"""Bias of the sensor, and the weight of what it stands under beside the arm."""


def at_base(model, data):
    """Give the wrench of the arm on its base about the world's origin, from MuJoCo's inverse dynamics, (6,)."""
    mujoco.mj_rnePostConstraint(model, data)
    moment, force = data.cfrc_int[1, :3], data.cfrc_int[1, 3:]  # of the base on the arm, about its centre of mass
    return -np.concatenate([force, moment + np.cross(data.subtree_com[1], force)])


class Scene:
    """An arm under a joint controller that is blind to contact, and an estimator that feels it."""

    def __init__(self, model=None, wrench_ee=UNTOUCHED, base=True, amplitude=0.0):
        self.model, self.base, self.wrench_ee = model or ARM.model, base, wrench_ee
        self.data, self.estimator, self.amplitude = mujoco.MjData(self.model), ContactEstimator(ARM), amplitude
        self.data.qpos[:] = ARM.home
        self.estimator.reset(ARM.home)
        self.pushed, self.force, self.tick = "link5", np.zeros(3), 0

    @property
    def point(self):
        return self.data.body(self.pushed).xipos

    @property
    def wrench(self):
        """True external wrench about the world's origin."""
        return np.concatenate([self.force, np.cross(self.point, self.force)])

    @property
    def found(self):
        return self.estimator.record["state"]["base"]

    def run(self, ticks, each=None):
        model, data = self.model, self.data
        for _ in range(ticks):
            phase = 4.0 * 0.001 * self.tick
            wanted = ARM.home + self.amplitude * np.sin(phase) * np.array([1.0, 0.5, -0.7, 0.6, 0.8, -0.5, 0.3])
            data.xfrc_applied[model.body(self.pushed).id, :3] = self.force
            data.qfrc_applied[:] = 400.0 * (wanted - data.qpos) - 40.0 * data.qvel + data.qfrc_bias
            mujoco.mj_forward(model, data)
            seen = at_base(model, data) + OFF if self.base else None
            torque = data.qfrc_applied - model.dof_armature * data.qacc
            measured = Measurement(data.qpos, data.qvel, self.wrench_ee, torque=torque, wrench_base=seen)
            contact = self.estimator.step(measured)
            if each is not None:
                each(self)
            mujoco.mj_step(model, data)
            self.tick += 1
        return contact


def test_nothing_is_told_until_the_offset_is_learned_and_then_none_of_it_is_left():
    scene = Scene()
    scene.run(200)
    assert scene.found["told"] == 0
    scene.run(400)
    assert scene.found["told"] == 1
    assert_allclose(scene.found["wrench"], 0.0, atol=0.02)


def test_in_motion_no_inertia_is_left_in_it():
    scene, most, sizes = Scene(amplitude=0.3), np.zeros(6), np.zeros(6)

    def each(one):
        most[:] = np.maximum(most, np.abs(one.found["wrench"]))
        sizes[:] = np.maximum(sizes, np.abs(one.found["rate"]))

    scene.run(1200)
    scene.run(800, each)
    assert sizes.max() > 5.0
    assert (most < 0.05 * sizes.max() + 0.1).all()


@pytest.mark.parametrize("amplitude", [0.0, 0.2])
def test_a_push_shows_as_its_wrench_about_the_origin(amplitude):
    scene = Scene(amplitude=amplitude)
    scene.run(1000)
    scene.force = FORCE
    scene.run(300)
    assert_allclose(scene.found["wrench"], scene.wrench, atol=0.8 if amplitude else 0.2)
    assert (np.abs(scene.found["wrench"] - scene.wrench) < 4.0 * scene.found["sigma"]).all()


def test_a_push_shows_when_the_joints_show_it():
    """Both go through the same filters: halves of what they come to are reached within two ticks of each other."""
    scene, rows = Scene(), []
    scene.run(1000)
    scene.force = FORCE

    def each(one):
        observer = one.estimator.record["state"]["observer"]
        rows.append((one.found["wrench"][1], observer["residual_fast"][0]))

    scene.run(200, each)
    base, joint = np.array(rows).T
    half = [int(np.argmax(np.abs(row) > 0.5 * np.abs(row[-1]))) for row in (base, joint)]
    assert abs(half[0] - half[1]) <= 2


@pytest.mark.parametrize("wrench_ee", [UNTOUCHED, None], ids=["zero wrench", "no wrench"])
@pytest.mark.parametrize("link", ["link3", "link5", "link6"])
def test_a_place_and_its_force_are_nearer_to_the_truth_and_the_set_is_smaller(link, wrench_ee):
    sizes, errors, forces = [], [], []
    for base in (True, False):
        scene = Scene(wrench_ee=wrench_ee, base=base)
        scene.run(1000)
        scene.pushed, scene.force = link, FORCE
        contact = scene.run(400)
        sizes.append(len(scene.estimator.places()))
        errors.append(np.linalg.norm(np.cross(contact.point - scene.point, FORCE)) / np.linalg.norm(FORCE))
        forces.append(np.linalg.norm(contact.force - FORCE))
    assert sizes[0] <= sizes[1]
    assert errors[0] < 0.03  # from the line of action: the push is at a point within the link
    assert errors[0] < errors[1] + 0.01
    assert forces[0] < min(1.5, forces[1] + 0.3)


def test_what_a_wrist_sensor_tells_of_the_tool_is_taken_out():
    force, scene = np.array([4.0, 0.0, 12.0]), Scene()
    scene.run(1000)
    tool = scene.data.site("tcp")
    scene.pushed = "tool"

    def pressed(one):
        moment = np.cross(tool.xpos - one.data.body("tool").xipos, force)
        one.data.xfrc_applied[one.model.body("tool").id, 3:] = moment

    pressed(scene)
    scene.force, scene.wrench_ee = force, np.concatenate([force, np.zeros(3)])
    contact = scene.run(300, pressed)
    assert_allclose(scene.found["wrench"], 0.0, atol=0.1)
    assert contact.kind == "tool"
    assert np.isnan(contact.point).all()


def test_links_heavier_than_the_model_leave_the_force_alone_and_widen_the_moment():
    heavier = ARM.model.__copy__()
    heavier.body_mass[4:7] *= 1.08
    scene = Scene(heavier)
    scene.run(1000)
    rest = scene.found["sigma"].copy()
    scene.force = FORCE
    scene.run(300)
    scene.amplitude = 0.5
    scene.run(1200)
    assert (np.abs(scene.found["wrench"] - scene.wrench)[:3] < 4.0 * scene.found["sigma"][:3]).all()
    assert (np.abs(scene.found["wrench"] - scene.wrench)[3:] < 4.0 * scene.found["sigma"][3:]).all()
    assert scene.found["sigma"][3:5].max() > 1.5 * rest[3:5].max()


def test_a_measurement_without_it_tells_nothing_and_it_is_learned_anew():
    scene = Scene()
    scene.run(600)
    scene.base = False
    scene.run(1)
    assert scene.found["told"] == 0
    scene.base = True
    scene.run(100)
    assert scene.found["told"] == 0
    scene.run(400)
    assert scene.found["told"] == 1


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e9])
def test_a_broken_one_is_left_out_and_named_and_changes_no_torque(bad):
    commands, faults = [], []
    for given in (None, np.full(6, bad)):
        plant, controller = Plant(ARM), controller_at(ARM, presets.safe())
        target, torques = hold(ARM), []
        for _ in range(50):
            out = controller.step(Measurement(plant.q, plant.qd, UNTOUCHED, wrench_base=given), target)
            torques.append(out.torque)
        commands.append(np.array(torques))
        faults.append(out.fault)
        assert out.bridged == 0
    assert_array_equal(*commands)
    assert faults == ["none", FAULTS[BAD_BASE]]


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (np.zeros(3), "wrench_base has shape (3,); give 6 numbers"),
        (np.zeros((2, 6)), "wrench_base has shape (2, 6); give 6 numbers"),
        ("heavy", "wrench_base is str, not numbers; give 6 numbers"),
    ],
)
def test_what_is_no_wrench_is_told_in_one_line(given, text):
    estimator = ContactEstimator(ARM)
    estimator.reset(ARM.home)
    with pytest.raises(InvalidInputError) as raised:
        estimator.step(Measurement(ARM.home, np.zeros(7), torque=np.zeros(7), wrench_base=given))
    assert str(raised.value) == text


def test_several_contacts_are_told_that_joint_torques_take_for_one():
    """Two opposed pushes: their wrench is a couple, which no single force has."""
    told = []
    for base in (True, False):
        scene = Scene(base=base)
        scene.run(1000)

        def opposed(one):
            for link, force in (("link4", [0.0, 20.0, 0.0]), ("link6", [0.0, -20.0, 0.0])):
                one.data.xfrc_applied[one.model.body(link).id, :3] = force

        scene.pushed = "link4"
        scene.force = np.array([0.0, 20.0, 0.0])
        opposed(scene)
        told.append(scene.run(400, opposed).several)
    assert told[0]


def test_what_has_passed_between_two_measurements_is_the_mean_of_it():
    """Measured every fourth millisecond, a push shows as much as at every one."""
    found = []
    for every in (1, 4):
        scene = Scene(base=True)
        scene.estimator = ContactEstimator(ARM, dt=0.001 * every)
        scene.estimator.reset(ARM.home)
        step = scene.estimator.step
        rows = []

        def sparse(measured, step=step, rows=rows, every=every):
            rows.append(measured)
            return step(measured) if len(rows) % every == 1 or every == 1 else None

        scene.estimator.step = sparse
        scene.run(1000)
        scene.force = FORCE
        scene.run(400)
        found.append(scene.found["wrench"].copy())
    for one, other in pairwise(found):
        assert_allclose(one, other, atol=0.3)


def test_a_contact_that_the_joints_do_not_feel_is_not_taken_for_the_offset():
    """A light push along the first axis, upwards through the base: the joints hold it unnoticed for a while."""
    scene = Scene()
    scene.run(700)
    scene.pushed, scene.force = "link2", np.array([0.0, 0.0, 12.0])
    contact = scene.run(600)
    assert not contact.touched
    assert scene.found["wrench"][2] > 10.0
    assert scene.found["sigma"][2] < 1.0
