"""Models as people download them: servos, gravcomp, no site, 2 ms, limits in a class. One symptom a test."""

import re

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.robot.worlds import ELBOW, cell

from contactsafe import robots
from contactsafe.core.errors import InvalidInputError, ModelWarning

SERVO = """
<mujoco model="servo">
  <compiler angle="radian" autolimits="true"/>
  <default>
    <joint armature="0.1" damping="1" range="-2.8 2.8"/>
    <general gaintype="fixed" biastype="affine" gainprm="2000" biasprm="0 -2000 -200" ctrlrange="-2.8 2.8"/>
  </default>
  <worldbody>
    <body name="base">
      <geom type="cylinder" size="0.06 0.05" mass="2"/>
      <body name="shoulder" pos="0 0 0.1" gravcomp="1"><joint name="s1"/><geom size="0.05" mass="2"/>
        <body name="upper" pos="0 0 0.1" gravcomp="1"><joint name="s2" axis="0 1 0"/>
          <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.04" mass="3"/>
          <body name="fore" pos="0 0 0.3" gravcomp="1"><joint name="s3" axis="0 1 0"/>
            <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" mass="2"/>
            <body name="hand" pos="0.3 0 0" gravcomp="1"><joint name="s4" axis="1 0 0"/>
              <geom type="box" size="0.02 0.02 0.02" pos="0.07 0 0" mass="0.3"/>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <general name="a1" joint="s1" forcerange="-60 60"/>
    <general name="a2" joint="s2" forcerange="-60 60" dyntype="filterexact" dynprm="0.01"/>
    <general name="a3" joint="s3" forcerange="-40 40"/>
    <general name="a4" joint="s4" forcerange="-12 12"/>
  </actuator>
  <keyframe><key name="ready" qpos="0 0.3 0.2 0" ctrl="0 0.3 0.2 0" act="0.3"/></keyframe>
</mujoco>
"""
"""Four joints as a model zoo has them: nothing of it can be bound as it comes."""

FLANGE = robots.Flange("hand", (0.1, 0.0, 0.0), name="tool")

pytestmark = pytest.mark.filterwarnings("ignore:arm:UserWarning")


def servo(*replacements):
    xml = SERVO
    for old, new in zip(replacements[::2], replacements[1::2], strict=True):
        assert old in xml
        xml = xml.replace(old, new)
    return mujoco.MjSpec.from_string(xml)


def test_one_call_loads_what_took_six_rounds_of_edits():
    arm = robots.from_mjcf(servo(), FLANGE, actuators="torque")
    assert_array_equal(arm.tau_max, [60.0, 60.0, 40.0, 12.0])
    assert_array_equal(arm.home, [0.0, 0.3, 0.2, 0.0])
    assert arm.site == "tool"


def test_mjspec_was_taken_for_the_name_of_a_file(tmp_path):
    spec = servo()
    before = spec.to_xml()
    from_spec = robots.from_mjcf(spec, FLANGE, actuators="torque")
    assert spec.to_xml() == before
    (tmp_path / "servo.xml").write_text(SERVO, encoding="utf-8")
    from_file = robots.from_mjcf(tmp_path / "servo.xml", FLANGE, actuators="torque")
    q = np.full(4, 0.3)
    assert_array_equal(from_spec.dynamics(q, q)["M"], from_file.dynamics(q, q)["M"])


def test_users_own_scene_is_driven_by_torque_after_one_edit():
    spec = servo()
    site = robots.make_torque_driven(spec, FLANGE)
    model = spec.compile()
    arm = robots.from_mjcf(model, site)
    at = arm.bind(model)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    assert not data.ctrl.any()
    assert model.opt.timestep == 0.001
    torque = 0.5 * arm.tau_max
    data.ctrl[at.ctrl] = torque / at.gear
    mujoco.mj_forward(model, data)
    assert_allclose(data.qfrc_actuator[at.dof], torque)
    assert not model.body_gravcomp.any()


def test_it_holds_itself_where_its_home_is():
    """What gravity takes at home, given by the motors, leaves the arm where it is."""
    spec = servo()
    site = robots.make_torque_driven(spec, FLANGE)
    model = spec.compile()
    arm = robots.from_mjcf(model, site)
    at, data = arm.bind(model), mujoco.MjData(model)
    data.qpos[at.qpos] = arm.home
    for _ in range(200):
        data.ctrl[at.ctrl] = arm.dynamics(data.qpos[at.qpos], data.qvel[at.dof])["g"] / at.gear
        mujoco.mj_step(model, data)
    assert_allclose(data.qpos[at.qpos], arm.home, atol=1e-6)


def test_class_with_a_ctrlrange_in_radians_let_the_arm_fall():
    """A `<general>` that was made a `<motor>` by hand keeps it: 2.8 N m, where gravity takes 20."""
    motors = servo(
        'gaintype="fixed" biastype="affine" gainprm="2000" biasprm="0 -2000 -200" ', "",
        ' dyntype="filterexact" dynprm="0.01"', "", ' act="0.3"', "", ' gravcomp="1"', "",
    )  # fmt: skip
    with pytest.raises(InvalidInputError) as caught:
        robots.from_mjcf(motors, FLANGE)
    text = str(caught.value)
    assert text.startswith("gravity takes")
    assert "at joint 's2' (limit 2.8)" in text
    assert "the ctrlrange of 's2', 's3' is that of angles, give the motors a forcerange in N m" in text


def test_servo_made_a_motor_keeps_its_force_limit_and_not_its_range_of_angles():
    spec = servo()
    robots.make_torque_driven(spec, FLANGE)
    model = spec.compile()
    assert_array_equal(model.actuator_ctrlrange[:, 1], [60.0, 60.0, 40.0, 12.0])
    assert_array_equal(model.actuator_forcerange[:, 1], [60.0, 60.0, 40.0, 12.0])


def test_two_servos_on_a_joint_become_one_motor_of_the_stronger_ones_limit():
    both = '<velocity name="v3" joint="s3" kv="10" forcerange="-25 25"/><general name="a4"'
    spec = servo('<general name="a4"', both, 'ctrl="0 0.3 0.2 0"', 'ctrl="0 0.3 0.2 0 0"')
    robots.make_torque_driven(spec, FLANGE)
    model = spec.compile()
    assert model.nu == 4
    assert model.actuator("a3").forcerange[1] == 40.0


def test_motor_behind_a_gear_keeps_gear_and_limit():
    spec = servo(
        '<general name="a3" joint="s3" forcerange="-40 40"/>',
        '<position joint="s3" kp="9" gear="-20" forcerange="-2 2"/>',
    )
    robots.make_torque_driven(spec, FLANGE)
    model = spec.compile()
    at = robots.from_mjcf(model, "tool").bind(model)
    assert at.gear[2] == -20.0
    assert_allclose(robots.from_mjcf(model, "tool").tau_max[2], 40.0)


def test_joints_without_actuators_get_motors_of_the_limits_given():
    bare = servo(SERVO[SERVO.index("<actuator>") : SERVO.index("</mujoco>")], "")
    arm = robots.from_mjcf(bare, FLANGE, actuators="torque", tau_max=[60.0, 60.0, 40.0, 12.0])
    assert_array_equal(arm.tau_max, [60.0, 60.0, 40.0, 12.0])
    site = robots.make_torque_driven(bare, FLANGE, tau_max=[60.0, 60.0, 40.0, 12.0])
    assert arm.bind(bare.compile()).gear.tolist() == [1.0] * 4
    assert site == "tool"


def test_arm_that_follows_a_mocap_body_is_set_free():
    led = servo(
        "<worldbody>", '<worldbody><body name="leader" mocap="true"/>',
        "<actuator>", '<equality><weld body1="leader" body2="hand"/></equality><actuator>',
    )  # fmt: skip
    with pytest.raises(InvalidInputError, match="ties the arm"):
        robots.from_mjcf(led, FLANGE)
    robots.make_torque_driven(led, FLANGE)
    assert led.compile().neq == 0


def test_messages_came_one_at_a_time():
    spec = servo('forcerange="-60 60" dyntype="filterexact" dynprm="0.01"', "", ' act="0.3"', "")
    with pytest.raises(InvalidInputError) as caught:
        robots.from_mjcf(spec, FLANGE, home=[0.0, 3.0, 0.0, 0.0], torque_rate_max=0.0)
    text = str(caught.value)
    assert text.startswith("4 things do not fit: (1) body 'shoulder' and 3 more has gravcomp = 1; ")
    assert "(2) joint 's2' has no torque limit; give tau_max=[...], 4 numbers in N m" in text
    assert "(3) home[1] = 3 rad is outside [-2.8, 2.8]; move it inside" in text
    assert "(4) torque_rate_max = 0.0 must be greater than 0; give N m/s" in text


def test_what_keeps_an_arm_from_being_bound_is_told_at_once():
    spec = servo(' gravcomp="1"', "")
    arm = robots.from_mjcf(spec, FLANGE)
    with pytest.raises(InvalidInputError) as caught:
        arm.bind(spec.compile())
    text = str(caught.value)
    assert "actuators 'a1', 'a2', 'a3', 'a4' are no motors" in text
    assert "robots.make_torque_driven(spec, 'tool')" in text
    assert "timestep of 0.002 s does not divide" in text


def test_key_frame_of_another_name_is_found_by_it_or_its_beginning():
    others = '<key name="ready" qpos="0 0.3 0.2 0"/><key name="rest" qpos="0 1 1 0"/>'
    spec = servo('<key name="ready" qpos="0 0.3 0.2 0" ctrl="0 0.3 0.2 0" act="0.3"/>', others)
    for name in ("rest", "res"):
        assert_array_equal(robots.from_mjcf(spec, FLANGE, actuators="torque", home=name).home, [0.0, 1.0, 1.0, 0.0])
    with pytest.raises(InvalidInputError, match=r"home = 're' is none of the key frames; give one of 'ready', 'rest'"):
        robots.from_mjcf(spec, FLANGE, actuators="torque", home="re")
    with pytest.warns(ModelWarning, match=r"home is one that was chosen here, since no key frame is called 'home'"):
        robots.from_mjcf(spec, FLANGE, actuators="torque")


def test_key_frame_with_the_prefix_of_attach_is_home():
    parent = mujoco.MjSpec.from_string("<mujoco><worldbody><frame name='f'/></worldbody></mujoco>")
    parent.compiler.degree = False
    parent.attach(servo('name="ready"', 'name="home"'), prefix="left/", frame=parent.frame("f"))
    parent.add_key(name="elsewhere", qpos=np.zeros(4))
    hand = robots.Flange("left/hand")
    arm = robots.from_mjcf(parent, hand, actuators="torque")
    assert_array_equal(arm.home, [0.0, 0.3, 0.2, 0.0])


@pytest.mark.parametrize(
    ("replacements", "text"),
    [
        (['"0 0.3 0.2 0" ctrl', '"0 2.75 0.2 0" ctrl'], r"home = 2\.75 rad of joint 's2' is within 0\.2 rad of an end"),
        (['fromto="0 0 0 0.3 0 0"', 'fromto="0 0 0 0.05 0 -0.42"'], r"at home the arm touches something: .*'shoulder'"),
        (['name="s3" axis="0 1 0"', 'name="s3" axis="0 1 0" stiffness="9"'], r"joint 's3' has a spring \(stiffness\)"),
        ([], r"4 joints cannot serve all six coordinates of a pose"),
        (['<body name="base">', '<body name="base"><freejoint name="free"/>',
          'qpos="0', 'qpos="0 0 1 1 0 0 0 0'], r"joint 'free' lets the base move"),
    ],
    ids=["beside the end of a range", "touches itself", "spring", "four joints", "floating base"],
)  # fmt: skip
def test_nothing_was_said_about_the_start(replacements, text):
    joints = ["s1", "s2", "s3", "s4"]
    with pytest.warns(ModelWarning, match=text) as said:
        robots.from_mjcf(servo(*replacements), FLANGE, joints, actuators="torque")
    assert len(said) == 1


def test_key_frame_that_the_motors_cannot_hold_is_refused():
    with pytest.raises(InvalidInputError, match=r"gravity takes .* N m at joint 's2' \(limit 5\) at home, and the arm"):
        robots.from_mjcf(servo("-60 60", "-5 5"), FLANGE, actuators="torque")


def test_two_arms_of_one_scene_are_chosen_by_site_or_joints():
    model = cell()
    left = robots.from_mjcf(model, "left/tcp")
    right = robots.from_mjcf(model, "tip")
    assert {left.model.joint(i).name for i in range(7)} == {f"left/joint{i}" for i in range(1, 8)}
    assert not set(left.bind(model).ctrl) & set(right.bind(model).ctrl)


def test_both_arms_of_one_scene_get_motors():
    scene = mujoco.MjSpec()
    scene.compiler.degree = False
    for side in (-1.0, 1.0):
        child = servo(SERVO[SERVO.index("<keyframe>") : SERVO.index("</mujoco>")], "")
        scene.attach(child, prefix=f"{side:+.0f}/", frame=scene.worldbody.add_frame(pos=(0.0, side, 0.0)))
    for side in ("-1", "+1"):
        robots.make_torque_driven(scene, robots.Flange(f"{side}/hand", name=f"{side}/tool"))
    model = scene.compile()
    ctrl = [robots.from_mjcf(model, f"{side}/tool").bind(model).ctrl.tolist() for side in ("-1", "+1")]
    assert sorted(ctrl[0] + ctrl[1]) == list(range(8))


REFUSED = {
    "unknown body": ({"site": robots.Flange("palm")},
                     "body 'palm' of the flange is not in the model; give one of: base, shoulder, upper, fore, hand"),
    "no site": ({"site": None}, "site = None; give one of: none; or robots.Flange(BODY) to make one, on one of: "
                                "base, shoulder, upper, fore, hand"),
    "unknown drive": ({"actuators": "position"},
                      "actuators = 'position'; give 'torque' to replace servos by motors, or None"),
    "one joint": ({"joints": ["s1"]}, "1 hinge moves the site; an arm has two at least: name another site"),
    "a name for a list": ({"joints": "s1"}, "joints = 's1' is one name; give a list of names, from base to tip"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_asked_is_told_in_one_line(name):
    options, text = REFUSED[name]
    with pytest.raises(InvalidInputError) as caught:
        robots.from_mjcf(servo(), **{"site": FLANGE, "actuators": "torque"} | options)
    assert str(caught.value) == text


@pytest.mark.parametrize("site", ["tip", FLANGE])
def test_a_part_of_a_model_was_said_to_lack_a_site(tmp_path, site):
    """An xArm's file holds its bodies in a form that another file includes: to MuJoCo it is empty by itself."""
    part = tmp_path / "part.xml"
    part.write_text("<mujoco/>", encoding="utf-8")
    with pytest.raises(InvalidInputError, match="no bodies; if it is a part, give the file that includes it"):
        robots.from_mjcf(part, site, actuators="torque")


def test_a_key_frame_was_to_be_chosen_where_there_are_none():
    bare = re.sub(r"<keyframe>.*</keyframe>", "", SERVO, flags=re.DOTALL)
    with pytest.raises(InvalidInputError, match="home = 'ready', and the model has no key frames; give joint"):
        robots.from_mjcf(mujoco.MjSpec.from_string(bare), FLANGE, actuators="torque", home="ready")


def test_an_arm_without_any_actuator_is_to_get_motors():
    bare = re.sub(r"<actuator>.*</actuator>", "", SERVO, flags=re.DOTALL)
    bare = re.sub(r"<keyframe>.*</keyframe>", "", bare, flags=re.DOTALL)
    with pytest.raises(InvalidInputError, match='no actuator; give actuators="torque" for motors of their own'):
        robots.from_mjcf(mujoco.MjSpec.from_string(bare), FLANGE)


def test_unknown_keyword_is_named_with_those_there_are():
    with pytest.raises(TypeError, match=r"unexpected keyword argument 'tau'; there are actuators, tau_max, "):
        robots.from_mjcf(servo(), FLANGE, tau=[1.0])


def test_compiled_model_takes_no_flange():
    with pytest.raises(InvalidInputError, match="a compiled MjModel takes no more sites; give the path or the MjSpec"):
        robots.from_mjcf(servo().compile(), FLANGE, actuators="torque")


def test_compiled_model_is_read_as_if_its_servos_were_motors():
    spec = servo()
    spec.body("hand").add_site(name="tool", pos=(0.1, 0.0, 0.0))
    read = robots.from_mjcf(spec.compile(), "tool", actuators="torque")
    assert_array_equal(read.tau_max, robots.from_mjcf(servo(), FLANGE, actuators="torque").tau_max)


def test_urdf_given_to_the_wrong_reader_is_told(tmp_path):
    (tmp_path / "arm.urdf").write_text("<robot name='a'/>", encoding="utf-8")
    with pytest.raises(InvalidInputError, match=r"arm\.urdf' is a URDF; give it to robots\.from_urdf$"):
        robots.from_mjcf(tmp_path / "arm.urdf", "tip")


def test_models_without_notes_are_silent():
    with pytest.warns(ModelWarning, match="2 joints"):
        robots.from_mjcf(mujoco.MjModel.from_xml_string(ELBOW), "tip")
