"""Everything public is copied, pickled and sent to other processes whole: what goes on there shares nothing with here.

`ACTORS` has an entry for every public class that is no plain record; a new one is missed by the first test.
"""

import copy
import dataclasses
import gc
import importlib
import inspect
import multiprocessing
import pickle
import pkgutil
import typing

import cloudpickle
import gymnasium
import numpy as np
import pytest

import contactsafe as cs
from contactsafe.control.moving_base import MovingBase
from contactsafe.control.records import controller_dtype
from contactsafe.core.copying import OfTraining, Threads, Unique
from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.collision_motions import sample_motion
from contactsafe.experiments.late_worlds import FROZEN, LOST, SEEN, LatePlayback, LateWorlds
from contactsafe.experiments.motions import Playback
from contactsafe.logs.clearance import Clearance
from contactsafe.policy.bundle import Bundle, shipped_bundle
from contactsafe.policy.perception import Perception
from contactsafe.policy.policy import Policy
from contactsafe.robot.dynamics import forward_kinematics
from contactsafe.robot.findings import Findings
from contactsafe.robot.ik import InverseKinematics
from contactsafe.sim.config import REAL_SENSORS
from contactsafe.sim.worlds import Worlds
from contactsafe.tasks.base.episodes import TaskEpisodes
from contactsafe.tasks.base.pushes import Pushes
from contactsafe.tasks.base.scripted import RandomPolicy
from contactsafe.tasks.base.task_env import TaskEnv
from contactsafe.tasks.insertion.config import InsertionConfig
from contactsafe.tasks.insertion.scenes import Insertion
from contactsafe.tasks.insertion.scripted import SpiralSearch, StraightDown
from contactsafe.tasks.insertion.tasks import InsertionTasks
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.randomisation import Randomisation
from contactsafe.tasks.wiping.sampling import MaskSampler
from contactsafe.tasks.wiping.scenes import Wiping
from contactsafe.tasks.wiping.scripted import NearestInk, Raster
from contactsafe.tasks.wiping.tasks import WipingTasks
from contactsafe.tasks.wiping.whiteboard import Whiteboard

VARIED = WipingConfig(randomisation=Randomisation.broad(), pushes=Pushes())
PUSHED = InsertionConfig(pushes=Pushes())
RNG = np.random.default_rng(0)
ACTIONS = RNG.uniform(-1.0, 1.0, (64, 2, 18)).astype(np.float32)


def observation(n=2):
    rng = np.random.default_rng(1)
    vectors = {"pose": 6, "target": 18, "force": 3}
    mask = np.where(rng.uniform(size=(n, 128, 128, 1)) < 0.01, 0, 255).astype(np.uint8)
    return {**{name: 0.1 * rng.normal(size=(n, k)).astype(np.float32) for name, k in vectors.items()}, "mask": mask}


def homography():
    return WipingTasks().boards.homography


# What each does next, as arrays; called again it goes on from there.


def evaluate_arm(arm):
    return [arm.dynamics(arm.home, np.ones(arm.n))["M"], arm.tool_pose(arm.home).position, arm.surface]


def evaluate_nominal(nominal):
    found = np.zeros(3), np.zeros((3, 3)), np.zeros((6, 7))
    forward_kinematics(nominal.handle, np.linspace(-0.5, 0.5, 7), *found)
    return list(found)


def clear(clearance):
    postures = cs.robots.panda().home + np.linspace(0.0, 1.5, 5)[:, None]
    return [np.array([clearance.is_free(posture[None]) for posture in postures])]


def solve(ik):
    return [ik.solve(cs.Pose(np.array([0.5, 0.1, 0.2]), np.array([0.0, 1.0, 0.0, 0.0])))]


def estimator():
    one = cs.ContactEstimator(cs.robots.panda())
    one.reset(one.arm.home)
    return one


def feel(estimator):
    """Feel a touch that has begun: where it is depends on the baseline before."""
    arm, felt = estimator.arm, []
    ticks = int(estimator.record["state"]["link_masses"]["ticks"])
    held = arm.dynamics(arm.home, np.zeros(arm.n))["g"]
    for k in range(ticks, ticks + 40):
        push = np.array([2.0, 4.0, 1.0, -3.0, 0.2, 0.0, 0.0]) if k >= 20 else 0.0
        contact = estimator.step(cs.Measurement(arm.home, np.zeros(arm.n), np.zeros(6), torque=held - push))
        felt += [contact.torque, contact.point, contact.force]
    return felt


def drive(controller):
    """Swing about the home pose with a push: the residual, and so the torque, depends on all that was before."""
    arm, torques = controller.arm, []
    start = int(controller.record["state"]["link_masses"]["ticks"])
    target = cs.Target(arm.tool_pose(arm.home), np.full(6, 200.0))
    for k in range(start, start + 30):
        swing = 0.01 * np.sin(0.05 * k + np.arange(7))
        out = controller.step(cs.Measurement(arm.home + swing, 0.5 * np.cos(0.05 * k + np.arange(7))), target)
        torques.append(np.concatenate([out.torque, out.residual]))
    return torques


def run_worlds(worlds):
    worlds.run(5)
    return [worlds.records["truth"]["q"].copy(), worlds.controllers["output"]["torque"].copy()]


def run_tasks(tasks):
    step = int(tasks.tasks["steps"][0])
    tasks.step(ACTIONS[step, : tasks.worlds.n])
    return [*tasks.observation().values(), tasks.reward, tasks.worlds.records["errors"]["q_seen"].copy()]


def run_episodes(episodes):
    episodes.step(np.full((episodes.worlds.n, 18), 0.3))
    return [*episodes.observation().values(), *episodes.curves().values(), episodes.pictures()]


def step_env(env):
    step = int(env.unwrapped.tasks.tasks["steps"][0])
    seen, reward, *_ = env.step(ACTIONS[step, 0])
    return [*seen.values(), reward]


def step_envs(envs):
    step = int(envs.unwrapped.tasks.tasks["steps"][0])
    seen, reward, *_ = envs.step(ACTIONS[step])
    return [*seen.values(), reward]


def vary(variation):
    variation.sample(0, np.random.default_rng(abs(int(1e9 * variation.sampled["payload_kg"][0]))))
    variation.look_first(0)
    return [variation._worlds.models[0].body_mass.copy(), variation._boards.masks.copy()]


def push(schedule):
    schedule._worlds.records["tick"] += 5000
    schedule.step()
    return [schedule._worlds.records["push"]["force"].copy()]


def play(playback):
    playback.step()
    return [playback.worlds.records["errors"]["q_seen"].copy(), playback._tool.copy()]


def draw(board):
    board.sample_random(np.random.default_rng(board.ink_cells))
    return [board.cells.copy()]


def draw_all(boards):
    for i, board in enumerate(boards.boards):
        board.sample_random(np.random.default_rng(int(boards.ink_cells()[i])))
    boards.enter_changed()
    return [boards.cells.copy(), boards.ink_cells(), boards.ink_index.shown.copy()]


def sample(sampler):
    return list(sampler.sample(2, 0))


def infer(bundle):
    shapes = {"state": 27, "latent": bundle.manifest["latent_size"]}
    inputs = {port.name: np.full((2, port.shape[1]), 0.1, np.float32) for port in bundle.policy.get_inputs()}
    assert set(inputs) == set(shapes)
    return bundle.policy.run(["action"], inputs)


def act(policy):
    return [policy.act(observation()) for _ in range(3)]


def search(script):
    seen = {"offset": np.zeros((2, 6)), "target": np.zeros((2, 18)), "wrench": np.full((2, 6), 4.0)}
    return [script.act(seen) for _ in range(3)]


def perceive(perception):
    seen = observation()
    return [perception(seen["mask"], seen["pose"])]


def compute(threads):
    return [threads.submit(np.square, k).result() for k in range(4)]


def carry(base):
    """Move on by what was told before: the velocities tell the acceleration."""
    nominal = cs.robots.panda().nominal()
    base.pass_time(0.001)
    base.tell(cs.Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])), base._twist + 0.1, None)
    base.place(nominal)
    return [nominal.handle["gravity"].copy(), nominal.handle["base_twist"].copy()]


def find(findings):
    findings.problem(f"no joint {len(findings._problems)}")
    with pytest.raises(InvalidInputError) as caught:
        findings.raise_problems()
    return [np.frombuffer(str(caught.value).encode(), np.uint8)]


# How each is made, in the midst of what it does.


def begun(make, go_on):
    def made():
        actor = make()
        go_on(actor)
        return actor

    return made


def controller():
    made = cs.Controller(cs.robots.panda())
    made.reset(made.arm.home)
    return made


def worlds(kind=Worlds):
    made = kind(cs.robots.panda(), n=2, seed=3)
    for i in range(2):
        made.reset(i, made.arm.home)
    made.push(0, "link4", (0.0, 0.0, 0.0), (0.0, 20.0, 0.0), 0.001, 1.0)
    return made


def tasks(config=VARIED, kind=WipingTasks):
    made = kind(config, 2, 3)
    for i in range(2):
        made.reset(i, np.random.default_rng(i))
    return made


def inserting():
    return tasks(PUSHED, InsertionTasks)


def inserting_episodes():
    return TaskEpisodes(InsertionTasks(PUSHED, 2, [0, 1]), [0, 1])


def env():
    made = gymnasium.make("contactsafe/Wiping-v0", config=VARIED)
    made.reset(seed=3)
    return made


def bare_env():
    return env().unwrapped


def envs():
    made = gymnasium.make_vec("contactsafe/Wiping-v0", num_envs=2, config=VARIED)
    made.reset(seed=3)
    return made


def playback():
    arm = cs.robots.panda()
    motions = [sample_motion(arm, 0), sample_motion(arm, 1)]
    return Playback(Worlds(arm, [motion.world((), REAL_SENSORS) for motion in motions], n=2, seed=[0, 1]), motions)


def late_worlds():
    arm, codes = cs.robots.panda(), np.resize([SEEN, LOST, SEEN, FROZEN], (2, 200))
    made = LateWorlds(arm, 2 * [VARIED.world], cs.presets.safe(), [0, 1], codes, True)
    for i in range(2):
        made.reset(i, arm.home)
    return made


def late_playback():
    arm = cs.robots.panda()
    motions = [sample_motion(arm, 0), sample_motion(arm, 1)]
    worlds = Worlds(arm, [motion.world((), REAL_SENSORS) for motion in motions], n=2, seed=[0, 1])
    return LatePlayback(worlds, motions, 200, 2 * [(30, 60)])


def encoded():
    from contactsafe.learning.vec_env import EncodedVecEnv
    from contactsafe.policy.observation import ObservationScaling

    made = envs()
    perception = Perception(None, "log_polar", 0.64, 128, made.camera_homography, threaded=True)
    scaling = ObservationScaling(
        ("pose",), (0.0,) * (6 + perception.latent_size), (1.0,) * (6 + perception.latent_size)
    )
    made = EncodedVecEnv(made, perception, scaling)
    made.reset()
    return made


def step_encoded(vec_env):
    return list(vec_env.step(ACTIONS[int(vec_env._steps[0])])[:2])


def photographed():
    pytest.importorskip("cv2")
    return tasks(WipingConfig(image_source="photograph"))


def photographer():
    return photographed()._photographs._photographers[0]


def take(photographer):
    seen = photographer.solids_at(np.array(cs.robots.panda().home))
    return [photographer.take(np.zeros((250, 300), np.uint8), seen, 1, 2)]


def goal():
    pytest.importorskip("cv2")
    from contactsafe.tasks.wiping.robot_goal import Goal

    return Goal()


def choose(goal):
    """What is shown of two strokes: the nearer one, once it has been chosen."""
    mask = np.full((64, 64), 255, np.uint8)
    mask[30:34, 20:26] = mask[10:14, 50:56] = 0
    return [goal.show(mask, mask == 0, np.array([20.0, 20.0]), True)]


def segment(segmenter):
    return [segmenter.segment(np.full((455, 455, 3), 200, np.uint8), np.zeros((455, 455), np.uint8))]


def plotter():
    from contactsafe.report.plots import Plotter

    return Plotter(["safe", "paper"])


ACTORS = {
    "Arm": (cs.robots.panda, evaluate_arm),
    "NominalModel": (lambda: cs.robots.panda().nominal(), evaluate_nominal),
    "Clearance": (lambda: Clearance(cs.robots.panda(), 0.0), clear),
    "InverseKinematics": (lambda: InverseKinematics(cs.robots.panda()), solve),
    "Controller": (begun(controller, drive), drive),
    "ContactEstimator": (begun(estimator, feel), feel),
    "Worlds": (begun(worlds, run_worlds), run_worlds),
    "Whiteboard": (lambda: Whiteboard(VARIED.board), draw),
    "Variation": (lambda: tasks()._variation, vary),
    "Whiteboards": (begun(lambda: tasks().boards, draw_all), draw_all),
    "PushSchedule": (lambda: tasks()._pushes, push),
    "WipingTasks": (begun(tasks, run_tasks), run_tasks),
    "InsertionTasks": (begun(inserting, run_tasks), run_tasks),
    "TaskEnv": (begun(bare_env, step_env), step_env),
    "wrapped TaskEnv": (begun(env, step_env), step_env),
    "TaskVectorEnv": (begun(envs, step_envs), step_envs),
    "TaskEpisodes": (begun(inserting_episodes, run_episodes), run_episodes),
    "MaskSampler": (MaskSampler, sample),
    "Photographer": (begun(photographer, take), take),
    "PhotographSource": (begun(photographed, run_tasks), run_tasks),
    "Segmenter": (lambda: photographed()._photographs._segmenter, segment),
    "Goal": (begun(goal, choose), choose),
    "Playback": (begun(playback, play), play),
    "LateWorlds": (begun(late_worlds, run_worlds), run_worlds),
    "LatePlayback": (begun(late_playback, play), play),
    "Bundle": (lambda: Bundle.load(shipped_bundle("wiping")), infer),
    "Policy": (begun(lambda: Policy(shipped_bundle("wiping"), homography()), act), act),
    "Perception": (lambda: Perception(None, "log_polar", 0.64, 128, homography(), threaded=True), perceive),
    "EncodedVecEnv": (begun(encoded, step_encoded), step_encoded),
    "Raster": (begun(lambda: Raster(VARIED, 2), lambda r: [r.act(observation())]), lambda r: [r.act(observation())]),
    "NearestInk": (lambda: NearestInk(VARIED, 2, homography()), lambda r: [r.act(observation())]),
    "SpiralSearch": (begun(lambda: SpiralSearch(PUSHED, 2), search), search),
    "StraightDown": (begun(lambda: StraightDown(PUSHED, 2), search), search),
    "RandomPolicy": (lambda: RandomPolicy(2, 0), lambda r: [r.act(observation())]),
    "Threads": (begun(lambda: Threads(2), compute), compute),
    "Insertion": (Insertion, lambda task: [np.array(task.stage.corners)]),
    "InsertionEpisodes": (begun(lambda: Insertion().episodes("safe", [0, 1]), run_episodes), run_episodes),
    "Wiping": (Wiping, lambda task: [np.array(task.stage.corners)]),
    "WipingEpisodes": (begun(lambda: Wiping().episodes("safe", [0, 1]), run_episodes), run_episodes),
    "MovingBase": (begun(MovingBase, carry), carry),
    "Findings": (begun(Findings, find), find),
    "Plotter": (plotter, lambda p: [p._count]),
}
"""How each is made in the midst of what it does, and what it does next, as arrays."""

NETWORKS = {"DeployedPolicy", "VAE", "MaskEncoder"}
"""PyTorch's own: it copies them."""

BASES = {"Environment", "Independent", "Instance", "TaskScenes", "Tasks"}
"""Nothing by themselves: their subclasses have entries."""


def public_classes():
    for found in pkgutil.walk_packages(cs.__path__, "contactsafe."):
        if found.name.endswith("__main__"):
            continue
        try:
            module = importlib.import_module(found.name)
        except ImportError:  # an extra that is not installed here
            continue
        for name, kind in inspect.getmembers(module, inspect.isclass):
            if kind.__module__ == found.name and not name.startswith("_"):
                yield name, kind


def is_plain(kind):
    """Whether a class is but data or words: a record, an error, a protocol."""
    record = dataclasses.is_dataclass(kind) or (issubclass(kind, tuple) and hasattr(kind, "_fields"))
    return (
        record or issubclass(kind, BaseException) or typing.is_typeddict(kind) or getattr(kind, "_is_protocol", False)
    )


HANDED_OVER = {
    "FrankaPort", "InsertionRobot", "InsertionWork", "MovedBlock", "WipingRobot", "WipedBoard", "CameraPictures",
    "PandaPort", "PhotographedBoard", "Drawing", "Square", "Distorted", "View", "PlaneView",
}  # fmt: skip
"""What a run hands to its processes before any of it begins, pickled: `tests/hardware` has runs. Until then it is a
plain record of what it was made of; the lenses are arrays."""


def test_every_public_class_has_an_entry():
    known = {*HANDED_OVER, *ACTORS, *NETWORKS, *BASES, "Call"}  # the last is how a model file is read
    missing = [
        name for name, kind in public_classes() if not (name in known or is_plain(kind) or issubclass(kind, Unique))
    ]
    assert missing == [], "give each an entry in ACTORS: how to make one, and what it does next"


def assert_same(a, b):
    assert len(a) == len(b)
    for one, other in zip(a, b, strict=True):
        np.testing.assert_array_equal(one, other)


COPIES = {
    "deep": copy.deepcopy,
    "shallow": copy.copy,
    "pickled": lambda actor: pickle.loads(pickle.dumps(actor)),
    "cloudpickled": lambda actor: cloudpickle.loads(cloudpickle.dumps(actor)),
}


@pytest.mark.parametrize("name", ACTORS)
def test_a_copy_goes_on_as_the_original_apart_from_it_and_outlives_it(name):
    """The copies act first: had one moved the original, that would come out elsewhere."""
    if name == "EncodedVecEnv":
        pytest.importorskip("stable_baselines3")
    make, go_on = ACTORS[name]
    original = make()
    copies = {kind: of(original) for kind, of in COPIES.items()}
    if isinstance(original, gymnasium.Wrapper):
        del copies["shallow"]  # Gymnasium's, not ours: what it wraps stays the same
    outcomes = {kind: go_on(copied) for kind, copied in copies.items()}
    expected = go_on(original)
    survivor = copy.deepcopy(original)
    next_expected = go_on(original)
    del original, copies
    gc.collect()
    for outcome in outcomes.values():
        assert_same(outcome, expected)
    assert_same(go_on(survivor), next_expected)


def go_on_elsewhere(actors):
    return {name: ACTORS[name][1](actor) for name, actor in actors.items()}


@pytest.mark.slow
@pytest.mark.parametrize("method", ["spawn", "forkserver"])
def test_pickled_ones_go_on_in_another_process(method):
    actors = {name: make() for name, (make, _) in ACTORS.items() if name != "EncodedVecEnv"}
    with multiprocessing.get_context(method).Pool(1) as pool:
        outcomes = pool.apply_async(go_on_elsewhere, (actors,)).get(timeout=300)
    for name, actor in actors.items():
        assert_same(outcomes[name], ACTORS[name][1](actor))


_INHERITED: dict = {}


def go_on_inherited(_):
    return go_on_elsewhere(_INHERITED)


@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_forked_ones_go_on_in_the_child_and_do_not_wait_for_threads_that_stayed_behind():
    _INHERITED.update({name: make() for name, (make, _) in ACTORS.items() if name != "EncodedVecEnv"})
    try:
        with multiprocessing.get_context("fork").Pool(1) as pool:
            outcomes = pool.apply_async(go_on_inherited, (0,)).get(timeout=120)
        for name, actor in _INHERITED.items():
            assert_same(outcomes[name], ACTORS[name][1](actor))
    finally:
        _INHERITED.clear()


@pytest.mark.parametrize("what", ["environment", "tasks", "worlds", "backend"])
def test_worlds_in_pybullet_refuse_to_be_copied(what):
    pytest.importorskip("pybullet")
    env = gymnasium.make("contactsafe/Wiping-v0", engine="pybullet")
    tasks = env.unwrapped.tasks
    held = {
        "environment": env.unwrapped, "tasks": tasks, "worlds": tasks.worlds, "backend": tasks.worlds.backends[0],
    }  # fmt: skip
    for of in COPIES.values():
        with pytest.raises(InvalidInputError) as caught:
            of(held[what])
        assert str(caught.value) == (
            "worlds in PyBullet cannot be copied or pickled, they live in a client of their own; make them where they "
            "are to run, or take the MuJoCo engine"
        )
    env.close()


def test_what_a_training_session_holds_open_refuses_to_be_copied():
    for of in COPIES.values():
        with pytest.raises(InvalidInputError) as caught:
            of(OfTraining())
        assert str(caught.value) == (
            "what a training session holds open cannot be copied or pickled; go on from its checkpoint, with --resume"
        )


@pytest.mark.parametrize("error", [cs.ContactSafeError, InvalidInputError])
def test_errors_come_back_from_other_processes(error):
    assert str(pickle.loads(pickle.dumps(error("what, found, allowed, remedy")))) == "what, found, allowed, remedy"


def test_controllers_that_share_records_are_copied_with_them():
    arm = cs.robots.panda()
    records = np.zeros(2, dtype=controller_dtype(arm.n))
    pair = [cs.Controller(arm, records=records, index=i) for i in range(2)]
    for one in pair:
        one.reset(arm.home)
    copied, (first, second) = copy.deepcopy((records, pair))
    expected = drive(pair[0]), drive(pair[1])
    assert_same(drive(first), expected[0])
    assert_same(drive(second), expected[1])
    assert copied["state"]["link_masses"]["ticks"].tolist() == [30, 30]


def test_what_a_user_hung_on_a_subclass_goes_along():
    class Mine(TaskEnv):
        def __init__(self):
            super().__init__("wiping", VARIED)
            self.seen = []

    mine = Mine()
    mine.seen.append(1)
    copied = copy.deepcopy(mine)
    copied.seen.append(2)
    assert (mine.seen, copied.seen) == ([1], [1, 2])


def test_copied_vector_environments_of_gymnasium():
    """SyncVectorEnv is copied whole; AsyncVectorEnv makes its environments in processes of their own."""
    envs = gymnasium.make_vec("contactsafe/Wiping-v0", num_envs=2, vectorization_mode="sync", config=WipingConfig())
    envs.reset(seed=1)
    copied = copy.deepcopy(envs)
    assert_same(list(copied.step(ACTIONS[0])[0].values()), list(envs.step(ACTIONS[0])[0].values()))


@pytest.mark.slow
@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
def test_gymnasiums_asynchronous_environments(method):
    kwargs = {"num_envs": 2, "config": WipingConfig()}
    alone = gymnasium.make_vec("contactsafe/Wiping-v0", vectorization_mode="sync", **kwargs)
    envs = gymnasium.make_vec(
        "contactsafe/Wiping-v0", vectorization_mode="async", vector_kwargs={"context": method}, **kwargs
    )
    alone.reset(seed=1)
    envs.reset(seed=1)
    assert_same(list(envs.step(ACTIONS[0])[0].values()), list(alone.step(ACTIONS[0])[0].values()))
    envs.close()


@pytest.mark.slow
@pytest.mark.train
@pytest.mark.parametrize("method", ["spawn", "forkserver"])
def test_stable_baselines3s_processes_take_an_environment_that_is_in_use(method):
    """What Ray does, too: the environment itself is pickled by cloudpickle within its function."""
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    made = env()
    made.step(ACTIONS[0, 0])
    envs = vec_env.SubprocVecEnv([lambda: made], start_method=method)
    seen, *_ = envs.step(ACTIONS[1, :1])
    for name, expected in made.step(ACTIONS[1, 0])[0].items():
        np.testing.assert_array_equal(seen[name][0], expected)
    envs.close()
