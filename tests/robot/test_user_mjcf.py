"""The arm inside a user's scene moves as the user's whole model does with everything else held still."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.robot.worlds import BALL_SHOULDER, ELBOW, MESH_JOINTS, MESHES, SIX, cell

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot import robots
from contactsafe.robot.arm import finite_range
from contactsafe.robot.ik import InverseKinematics
from contactsafe.robot.mjcf import arm_mjcf

TIGHT = {"rtol": 0.0, "atol": 1e-9}
PANDA_JOINTS = [f"left/joint{i}" for i in range(1, 8)]
SCENES = {
    "six": (lambda: mujoco.MjModel.from_xml_string(SIX), "tip", None),
    "elbow": (lambda: mujoco.MjModel.from_xml_string(ELBOW), "tip", None),
    "part of an arm": (lambda: mujoco.MjModel.from_xml_string(SIX), "tip", ["lift", "elbow", "wrist2"]),
    "ball shoulder": (lambda: mujoco.MjModel.from_xml_string(BALL_SHOULDER), "tip", None),
    "panda in a cell": (cell, "left/tcp", None),
    "panda on its head": (lambda: cell((0.0, 0.0, 2.0), (0.0, 1.0, 0.0, 0.0)), "left/tcp", PANDA_JOINTS),
    "six beside a panda": (cell, "tip", None),
    "meshes": (lambda: mujoco.MjModel.from_xml_string(MESHES), "tip", MESH_JOINTS),
    "nothing falls": (lambda: edited(ELBOW, "<worldbody>", '<option><flag gravity="disable"/></option><worldbody>'),
                      "tip", None),
}  # fmt: skip


def edited(xml: str, *replacements: str) -> mujoco.MjModel:
    """Compile a scene in which each of some texts was replaced by the text after it."""
    for old, new in zip(replacements[::2], replacements[1::2], strict=True):
        assert old in xml
        xml = xml.replace(old, new)
    return mujoco.MjModel.from_xml_string(xml)


@pytest.fixture(scope="module", params=SCENES)
def scene(request):
    """The user's model, the arm found in it, and the places of its joints in the user's q and q̇."""
    make, site, joints = SCENES[request.param]
    model = make()
    arm = robots.from_mjcf(model, site=site, joints=joints)
    ids = [model.joint(arm.model.joint(i).name).id for i in range(arm.n)]
    return model, arm, model.jnt_qposadr[ids], model.jnt_dofadr[ids]


def samples(arm, count=20):
    rng = np.random.default_rng(4)
    for _ in range(count):
        yield rng.uniform(*finite_range(arm.q_min, arm.q_max)), rng.uniform(-2.0, 2.0, arm.n)


def whole(model, address, dofs, q, qd):
    """Place the user's model: the arm as told, the rest held where it starts."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[address], data.qvel[dofs] = q, qd
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    return data


def bias(model, data, dofs):
    out = np.zeros(model.nv)
    mujoco.mj_rne(model, data, 0, out)
    return out[dofs]


def test_inertia_is_the_users(scene):
    model, arm, address, dofs = scene
    for q, qd in samples(arm):
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, whole(model, address, dofs, q, qd), M)
        assert_allclose(arm.dynamics(q, qd)["M"], M[np.ix_(dofs, dofs)], **TIGHT)


def test_gravity_and_coriolis_torque_are_the_users(scene):
    model, arm, address, dofs = scene
    for q, qd in samples(arm):
        ours = arm.dynamics(q, qd)
        g = bias(model, whole(model, address, dofs, q, 0.0 * qd), dofs)
        assert_allclose(ours["g"], g, **TIGHT)
        assert_allclose(ours["c"], bias(model, whole(model, address, dofs, q, qd), dofs) - g, **TIGHT)


def test_tool_frame_jacobian_and_its_rate_are_the_users(scene):
    model, arm, address, dofs = scene
    site = model.site(arm.site).id
    for q, qd in samples(arm):
        ours, data = arm.dynamics(q, qd), whole(model, address, dofs, q, qd)
        J, J_dot = np.zeros((6, model.nv)), np.zeros((6, model.nv))
        mujoco.mj_jacSite(model, data, J[:3], J[3:], site)
        mujoco.mj_jacDot(model, data, J_dot[:3], J_dot[3:], data.site_xpos[site], model.site_bodyid[site])
        assert_allclose(ours["position"], data.site_xpos[site], **TIGHT)
        assert_allclose(ours["rotation"].ravel(), data.site_xmat[site], **TIGHT)
        assert_allclose(ours["J"], J[:, dofs], **TIGHT)
        assert_allclose(ours["Jdot_qd"], J_dot[:, dofs] @ qd, **TIGHT)


def test_inertia_changes_as_the_coriolis_terms_say(scene):
    """Ṁ q̇ = C q̇ + Cᵀ q̇, wherever the base stands: what the momentum observer rests on."""
    _, arm, _, _ = scene
    for q, qd in samples(arm, 5):
        h = 1e-5
        M_dot = (arm.dynamics(q + h * qd, qd)["M"] - arm.dynamics(q - h * qd, qd)["M"]) / (2 * h)
        now = arm.dynamics(q, qd)
        assert_allclose(M_dot @ qd, now["c"] + now["CT_qd"], rtol=0, atol=1e-7)


def test_bound_motors_exert_the_torque_asked_for(scene):
    model, arm, address, dofs = scene
    at = arm.bind(model, tick_s=2 * model.opt.timestep)
    assert at.steps == 2
    assert_array_equal(at.qpos, address)
    assert_array_equal(at.dof, dofs)
    torque = np.random.default_rng(5).uniform(-1.0, 1.0, arm.n) * arm.tau_max
    data = mujoco.MjData(model)
    data.ctrl[at.ctrl] = torque / at.gear
    mujoco.mj_forward(model, data)
    assert_allclose(data.qfrc_actuator[at.dof], torque, **TIGHT)
    assert_allclose(np.delete(data.qfrc_actuator, at.dof), 0.0, atol=0)


@pytest.mark.parametrize("tool", [robots.HAND, robots.WIPER], ids=lambda tool: tool.name)
def test_round_trip_through_a_file(tmp_path, tool):
    panda = robots.panda(tool)
    path = tmp_path / "panda.xml"
    path.write_text(arm_mjcf(panda.description, tool), encoding="utf-8")
    read = robots.from_mjcf(path, site="tcp", friction=panda.friction, home=panda.home)
    for field in ("name", "site", "q_min", "q_max", "tau_max", "torque_rate_max", "friction", "home"):
        assert_array_equal(getattr(read, field), getattr(panda, field))
    for q, qd in samples(panda):
        ours, theirs = read.dynamics(q, qd), panda.dynamics(q, qd)
        for name in theirs.dtype.names:
            assert_allclose(ours[name], theirs[name], **TIGHT)


def test_reading_its_own_nominal_model_changes_nothing(scene):
    _, arm, _, _ = scene
    again = robots.from_mjcf(arm.model, site=arm.site, home=arm.home)
    q, qd = next(samples(arm))
    for name in arm.dynamics(q, qd).dtype.names:
        assert_allclose(again.dynamics(q, qd)[name], arm.dynamics(q, qd)[name], **TIGHT)


def test_open_fingers_weigh_where_they_are():
    """The gripper counts as it stands in the key frame 'home', not as the file draws it."""
    opened = robots.from_mjcf(cell(), site="left/tcp")
    model = cell()
    model.key_qpos[0, [model.joint(f"left/finger{side}").qposadr[0] for side in ("-1", "+1")]] = 0.0
    shut = robots.from_mjcf(model, site="left/tcp")
    still = np.zeros(7)
    more = opened.dynamics(opened.home, still)["M"][6, 6] - shut.dynamics(shut.home, still)["M"][6, 6]
    assert_allclose(more, 2 * 0.1 * (0.04**2 - 0.01**2), **TIGHT)


def test_limits_come_from_motors_gears_and_joints():
    six = robots.from_mjcf(mujoco.MjModel.from_xml_string(SIX), site="tip")
    assert_allclose(six.tau_max, [150.0, 150.0, 150.0, 28.0, 28.0, 28.0], rtol=1e-12)
    assert_array_equal(six.q_max, [6.28, 6.28, 3.14, 6.28, 6.28, 6.28])
    weak_joint = edited(SIX, 'name="wrist1"/>', 'name="wrist1" actuatorfrcrange="-20 25"/>')
    assert robots.from_mjcf(weak_joint, site="tip").tau_max[3] == 20.0
    asked = robots.from_mjcf(weak_joint, site="tip", tau_max=[10.0, 1e3, 1e3, 1e3, 1e3, 5.0]).tau_max
    assert_allclose(asked, [10.0, 150.0, 150.0, 20.0, 28.0, 5.0], rtol=1e-12)


def test_strong_motors_were_as_slow_as_a_pandas():
    """Unless it is given, the torque rate takes the strongest motor to its limit as fast as a Panda's does."""
    six = mujoco.MjModel.from_xml_string(SIX)
    rates = [
        robots.from_mjcf(six, site="tip", tau_max=np.full(6, tau_max), **given).torque_rate_max
        for tau_max, given in ((20.0, {}), (87.0, {}), (130.5, {}), (130.5, {"torque_rate_max": 500.0}))
    ]
    assert_allclose(rates, [1000.0, 1000.0, 1500.0, 500.0])


def test_home_is_the_key_frame_or_the_middle_of_the_range():
    keyed = robots.from_mjcf(cell(), site="left/tcp")
    assert_array_equal(keyed.home, robots.panda().home)
    assert_allclose(robots.from_mjcf(mujoco.MjModel.from_xml_string(ELBOW), site="tip").home, 0.0, atol=0)
    given = robots.from_mjcf(cell(), site="left/tcp", home=keyed.home + 0.1)
    assert_array_equal(given.home, keyed.home + 0.1)


def test_joint_that_turns_without_end_has_an_infinite_range():
    elbow = robots.from_mjcf(mujoco.MjModel.from_xml_string(ELBOW), site="tip")
    assert_array_equal(elbow.q_min, [-2.0, -np.inf])
    assert_array_equal(elbow.q_max, [2.0, np.inf])


def test_inverse_kinematics_of_joints_that_turn_without_end():
    free = edited(SIX, 'range="-6.28 6.28"', "", 'range="-3.14 3.14"', "")
    arm = robots.from_mjcf(free, site="tip")
    assert np.isinf(arm.q_max).all()
    pose = arm.tool_pose(arm.home + np.array([20.0, 0.2, -0.3, 0.1, 0.2, -0.4]))
    found = arm.tool_pose(InverseKinematics(arm).solve(pose))
    assert_allclose(found.position, pose.position, rtol=0, atol=1e-4)


def test_joints_of_an_arm_without_motors_are_named_and_limited_by_the_caller():
    bare = edited(ELBOW, ELBOW[ELBOW.index("<actuator>") : ELBOW.index("</mujoco>")], "")
    arm = robots.from_mjcf(bare, site="tip", joints=("a", "b"), tau_max=[5.0, 5.0])
    assert_array_equal(arm.tau_max, 5.0)
    with pytest.raises(InvalidInputError) as caught:
        arm.bind(bare, tick_s=0.002)
    assert str(caught.value) == """joints 'a', 'b' have no motor; add <motor joint="a"/> to <actuator>"""


MOTOR_A = '<motor joint="a" ctrlrange="-5 5" gear="3" armature="0.002"/>'
MOTOR_B = '<motor joint="b" ctrlrange="-5 5"/>'
REFUSED = {
    "unknown site": ([], {"site": "tcp"}, "site 'tcp' is not in the model; give one of: tip"),
    "no site": ([], {"site": None}, "site = None; give one of: tip"),
    "unknown joint": ([], {"joints": ["a", "c"]}, "joint 'c' is not in the model; give one of: a, b"),
    "wrong order": (
        [], {"joints": ["b", "a"]}, "joints = ['b', 'a'] are not in order; from base to tip they stand so: 'a', 'b'",
    ),
    "does not move the site": (
        ["<worldbody>", '<worldbody><body><joint name="o"/><geom size=".1"/></body>'], {"joints": ["a", "o"]},
        "joint 'o' does not move site 'tip'; joints that do, base to tip: 'a', 'b'",
    ),
    "slide": (
        ['name="a"', 'name="a" type="slide"'], {},
        "joint 'a' is of type slide; the arm's are hinges: give joints=[...] without it, to lock it",
    ),
    "not driven": (
        [MOTOR_A, ""], {}, "joint 'a' has no actuator; give joints=[...] with it, or without it, to lock it",
    ),
    "not driven, without a name": (
        [' name="b"', "", MOTOR_B, ""], {},
        "joint 1 (without a name) has no actuator; give joints=[...] with it, or without it, to lock it",
    ),
    "nothing moves": (
        ["<worldbody>", '<worldbody><site name="fixed"/>'], {"site": "fixed"},
        "no joints for site 'fixed'; give it to a body of the arm; joints that move it: none",
    ),
    "two motors": (
        [MOTOR_B, MOTOR_B + '<motor name="spare" joint="b"/>'], {},
        "joint 'b' has 2 actuators (1 (without a name), 'spare'); the controller gives one torque a joint: keep one",
    ),
    "no torque limit": (
        [MOTOR_B, '<motor joint="b"/>'], {},
        "joint 'b' has no torque limit; give tau_max=[...], 2 numbers in N m",
    ),
    "one-sided motor": (
        [MOTOR_B, '<motor joint="b" ctrlrange="0 5"/>'], {},
        "joint 'b' has a torque limit of 0 N m, which is not above 0; give its motor a forcerange on both sides of "
        "0, and no tau_max of 0",
    ),
    "carries itself": (
        ['name="plate"', 'name="plate" gravcomp="1"'], {},
        "body 'plate' has gravcomp = 1; the controller's torque includes gravity, so it must be 0 on every body of the "
        "arm",
    ),
    "tied": (
        ["<actuator>", '<equality><joint name="pair" joint1="a" joint2="b"/></equality><actuator>'], {},
        "equality constraint 'pair' ties the arm; an arm is a free chain of hinges, remove it",
    ),
    "bolted to the world": (
        ["<actuator>", '<equality><weld body1="plate"/></equality><actuator>'], {},
        "equality constraint 0 (without a name) ties the arm; an arm is a free chain of hinges, remove it",
    ),
    "home outside": ([], {"home": [3.0, 0.0]}, "home[0] = 3 rad is outside [-2, 2]; move it inside"),
    "torque limits of another arm": ([], {"tau_max": [5.0]}, "tau_max has shape (1,); give 2 finite numbers"),
    "friction of another arm": ([], {"friction": [0.0]}, "friction has shape (1,); give 2 × 3 finite numbers"),
    "no torque rate": ([], {"torque_rate_max": 0.0}, "torque_rate_max = 0.0 must be greater than 0; give N m/s"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_such_an_arm_is_refused_in_one_line(name):
    replacements, arguments, text = REFUSED[name]
    with pytest.raises(InvalidInputError) as caught:
        robots.from_mjcf(edited(ELBOW, *replacements), **{"site": "tip"} | arguments)
    assert str(caught.value) == text


def test_missing_and_broken_files_are_refused(tmp_path):
    with pytest.raises(InvalidInputError) as caught:
        robots.from_mjcf(Path("nowhere.xml"), site="tip")
    assert str(caught.value) == (
        "no file at 'nowhere.xml'; give the path of an MJCF file, a mujoco.MjSpec, or a compiled mujoco.MjModel"
    )
    with pytest.raises(InvalidInputError, match=r"^no file at '<mujoco>.{1,80}'; give the path"):
        robots.from_mjcf("<mujoco>" + 500 * "<worldbody/>" + "</mujoco>", site="tip")
    broken = tmp_path / "broken.xml"
    broken.write_text("<mujoco>\n<worldbody></mujoco>", encoding="utf-8")
    with pytest.raises(InvalidInputError, match=r"^MuJoCo cannot read '.*broken.xml': .*; mend the file$") as caught:
        robots.from_mjcf(broken, site="tip")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("replacements", "text"),
    [
        (
            [MOTOR_A, '<position joint="a" kp="10"/>'],
            "actuator 0 (without a name) of joint 'a' is no motor, which turns its control into torque and nothing "
            """else; replace it by <motor joint="a"/>, or edit the scene's MjSpec with """
            "robots.make_torque_driven(spec, 'tip')",
        ),
        (
            ["<worldbody>", '<option timestep="0.0007"/><worldbody>'],
            "the model's timestep of 0.0007 s does not divide the controller's tick of 0.002 s; "
            """set <option timestep="0.002"/>""",
        ),
        (['name="b"', 'name="c"', 'joint="b"', 'joint="c"'], "joint 'b' is not in the model; give one of: a, c"),
    ],
    ids=["servo", "timestep", "another model"],
)
def test_model_that_the_arm_cannot_be_bound_to_is_refused(replacements, text):
    arm = robots.from_mjcf(mujoco.MjModel.from_xml_string(ELBOW), site="tip")
    with pytest.raises(InvalidInputError) as caught:
        arm.bind(edited(ELBOW, *replacements), tick_s=0.002)
    assert str(caught.value) == text


def test_default_timestep_of_mujoco_is_refused_not_taken_for_a_tick():
    """The loop would run, and the observer would see twice the acceleration."""
    model = mujoco.MjModel.from_xml_string(ELBOW)
    with pytest.raises(InvalidInputError, match=r"^the model's timestep of 0\.002 s does not divide"):
        robots.from_mjcf(model, site="tip").bind(model)
