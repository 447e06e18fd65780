"""Localisation: scenes are what they claim, the limit is a posterior, figures are what they say."""

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.localisation import TWO, localisation
from contactsafe.experiments.localisation_metrics import METRICS, force_metrics, point_metrics, set_metrics
from contactsafe.experiments.onsets import pushed_links
from contactsafe.experiments.registry import ENTRIES
from contactsafe.experiments.surfaces import clearance
from contactsafe.experiments.touch_limit import (
    belief,
    dense_surface,
    force_at,
    force_covariance,
    is_no_single,
    jacobians,
    spacing,
)
from contactsafe.experiments.touch_scenes import (
    FORCE_N,
    MOVED_MS,
    PATH_M,
    REST_MS,
    STILL_MS,
    sample_touch_scene,
    sense,
    true_base_wrench,
    true_torque,
)
from contactsafe.robot import robots
from contactsafe.robot.arm import description_and_tool
from contactsafe.robot.shape import link_frames

ARM = robots.panda()
SURFACE = dense_surface(ARM)
seeds = st.integers(0, 3000)


def frames(q):
    return tuple(one[0] for one in link_frames(description_and_tool(ARM)[0], q[None]))


def posture(seed):
    return np.random.default_rng(seed).uniform(ARM.q_min + 0.2, ARM.q_max - 0.2)


@pytest.mark.parametrize("seed", range(8))
def test_a_touch_is_inwards_on_an_uncovered_point_and_the_second_is_on_another_link(seed):
    one, two = (sample_touch_scene(ARM, seed, contacts) for contacts in (1, 2))
    assert repr(one.touches[0]) == repr(two.touches[0])
    assert two.touches[0].link != two.touches[1].link
    assert PATH_M[0] <= one.path_m <= PATH_M[1]
    origins, rotations = frames(two.motion.q_start)
    for touch in two.touches:
        place, force = touch.in_world(origins, rotations)
        assert touch.link in pushed_links(ARM)
        assert FORCE_N[0] <= np.linalg.norm(force) <= FORCE_N[1]
        assert force @ (rotations[touch.link] @ touch.inwards) > 0.85 * np.linalg.norm(force)
        assert abs(clearance(ARM, two.motion.q_start[None], place)) < 1e-6


def test_targets_start_still_and_end_at_the_path_they_claim():
    scene = sample_touch_scene(ARM, 2, 1)
    places = np.array([scene.target(tick) for tick in range(MOVED_MS)])
    assert_allclose(places[:STILL_MS], np.broadcast_to(scene.motion.start.position, (STILL_MS, 3)))
    assert np.linalg.norm(places[-1] - places[0]) == pytest.approx(scene.path_m)
    assert scene.pressed(REST_MS) == 0.0
    assert scene.pressed(REST_MS + 200) == 1.0


@pytest.fixture(scope="module")
def touched():
    scenes = [sample_touch_scene(ARM, seed, 2) for seed in (1, 3)]
    return scenes, sense(ARM, scenes, real=False)


def test_joint_sensors_feel_the_contact_as_its_torque(touched):
    """What the torque changes by when the contact begins is the contact's, less what gravity changes meanwhile."""
    for scene, sensed in zip(*touched, strict=True):
        change = sensed.torque[STILL_MS - 50 : STILL_MS].mean(axis=0) - sensed.torque[REST_MS - 50 : REST_MS].mean(
            axis=0
        )
        gravity = [ARM.dynamics(sensed.q_true[tick], np.zeros(ARM.n))["g"] for tick in (STILL_MS, REST_MS)]
        assert_allclose(gravity[0] - gravity[1] - change, true_torque(ARM, scene, sensed.q_true[STILL_MS]), atol=0.5)


def test_the_arm_moves_after_it_was_still_and_sensors_agree_with_the_truth(touched):
    for _, sensed in zip(*touched, strict=True):
        assert_allclose(sensed.q, sensed.q_true, atol=2e-3)
        assert np.abs(sensed.q_true[-1] - sensed.q_true[STILL_MS]).max() > 0.05


def test_the_sensor_under_the_base_feels_the_contact_as_its_wrench(touched):
    """What it changes by when the contact begins is the contact's; the arm has hardly moved."""
    for scene, sensed in zip(*touched, strict=True):
        after, before = (sensed.wrench_base[tick - 50 : tick].mean(axis=0) for tick in (STILL_MS, REST_MS))
        true = true_base_wrench(ARM, scene, sensed.q_true[STILL_MS])
        assert_allclose((after - before)[:3], true[:3], atol=0.2)
        assert_allclose((after - before)[3:], true[3:], atol=1.0)


def test_a_scene_is_sensed_alike_alone_and_among_others(touched):
    scenes, sensed = touched
    (alone,) = sense(ARM, scenes[1:], real=False)
    assert_allclose(alone.torque, sensed[1].torque, atol=1e-9)
    assert_allclose(alone.wrench_base, sensed[1].wrench_base, atol=1e-6)


@given(seeds, st.integers(1, ARM.n))
def test_jacobians_are_the_simulators(seed, link):
    q, rng = posture(seed), np.random.default_rng(seed)
    origins, rotations = frames(q)
    point = origins[link] + rotations[link] @ rng.normal(0.0, 0.1, 3)
    data = mujoco.MjData(ARM.model)
    data.qpos[: ARM.n] = q
    mujoco.mj_kinematics(ARM.model, data)
    mujoco.mj_comPos(ARM.model, data)
    linear, angular = np.zeros((3, ARM.model.nv)), np.zeros((3, ARM.model.nv))
    body = ARM.model.body(f"link{link}").id
    mujoco.mj_jac(ARM.model, data, linear, angular, point, body)
    found = jacobians(ARM, q, point[None], np.array([link]))
    assert_allclose(found[0][0], linear[:, : ARM.n], atol=1e-9)
    assert_allclose(found[1][0], angular[:, : ARM.n], atol=1e-9)


@given(seeds)
def test_points_of_the_dense_surface_lie_on_the_arm_closer_than_the_estimators(seed):
    q = posture(seed)
    points, normals = SURFACE.at(q)
    for k in np.random.default_rng(seed).choice(np.flatnonzero(~SURFACE.on_tool), 5):
        assert clearance(ARM, q[None], points[k]) < 1e-6
    assert_allclose(np.linalg.norm(normals[~SURFACE.on_tool], axis=1), 1.0)
    assert SURFACE.apart < 0.6 * spacing(ARM.places)


@given(seeds)
def test_a_finer_grid_lies_about_its_points(seed):
    chosen = np.random.default_rng(seed).choice(np.flatnonzero(~SURFACE.on_tool), 6, replace=False)
    fine = SURFACE.refined(chosen)
    offsets = fine.rows[:, 1:4].reshape(6, -1, 3) - SURFACE.rows[chosen, None, 1:4]
    assert_allclose(offsets.mean(axis=1), 0.0, atol=1e-12)
    assert_allclose(np.einsum("pkj,pj->pk", offsets, SURFACE.rows[chosen, 4:]), 0.0, atol=1e-12)
    assert np.abs(offsets).max() < 0.71 * SURFACE.apart
    assert_allclose(fine.links.reshape(6, -1), np.repeat(SURFACE.links[chosen, None], offsets.shape[1], axis=1))


def of_one(seed):
    scene = sample_touch_scene(ARM, seed, 1)
    q = scene.motion.q_start
    return scene.touches[0], q, true_torque(ARM, scene, q), frames(q)


@pytest.mark.parametrize("seed", range(5))
def test_a_belief_is_a_distribution_that_more_noise_spreads(seed):
    _, q, torque, _ = of_one(seed)
    sharp, wide = (belief(SURFACE, [q], [torque], sigma, 0.0) for sigma in (0.05, 1.0))
    for known in (sharp, wide):
        assert known.probability.sum() == pytest.approx(1.0)
        assert known.probability[SURFACE.on_tool].max() == 0.0
        assert known.probability[known.likeliest(0.95)].sum() >= 0.95 - 1e-9
    assert len(sharp.likeliest(0.95)) < len(wide.likeliest(0.95))


def test_sets_hold_the_truth_as_often_as_they_claim_and_shrink_as_the_arm_moves():
    """95 % of 20 are 19; fewer than 16 would come once in a thousand."""
    held, places, rng = np.zeros(2), np.zeros(2), np.random.default_rng(0)
    for seed in range(20):
        scene = sample_touch_scene(ARM, seed, 1)
        (touch,) = scene.touches
        q = [scene.motion.q_start + moved * rng.uniform(-0.3, 0.3, ARM.n) for moved in (0.0, 0.5, 1.0)]
        torque = [true_torque(ARM, scene, one) + 0.1 * rng.standard_normal(ARM.n) for one in q]
        for k, postures in enumerate((1, 3)):
            known = belief(SURFACE, q[:postures], torque[:postures], 0.1, 0.0)
            likeliest = known.likeliest(0.95)
            place, _ = touch.in_world(*frames(q[postures - 1]))
            links, points = known.links[likeliest], known.points[likeliest]
            held[k] += set_metrics(links, points, SURFACE.apart, [(touch.link, place)])["in_set"]
            places[k] += len(likeliest)
    assert held.min() >= 16
    assert places[1] < 0.6 * places[0]


@pytest.mark.parametrize("seed", range(5))
def test_the_wrench_at_the_base_narrows_what_is_believed(seed):
    touch, q, torque, (origins, rotations) = of_one(seed)
    scene = sample_touch_scene(ARM, seed, 1)
    felt, sigma = np.concatenate([torque, true_base_wrench(ARM, scene, q)]), np.repeat([0.5, 0.5, 0.05], [7, 3, 3])
    without, told = belief(SURFACE, [q], [torque], 0.5, 0.0), belief(SURFACE, [q], [felt], sigma, 0.0)
    assert len(told.likeliest(0.95)) < len(without.likeliest(0.95))
    point, force = touch.in_world(origins, rotations)
    found = force_at(ARM, q, (touch.link, point, rotations[touch.link] @ touch.inwards), felt, sigma)
    assert_allclose(found, force, atol=1.0)
    assert not is_no_single(SURFACE, [q], [felt], sigma)


def test_opposed_contacts_are_told_more_often_with_it():
    told, sigma = np.zeros(2), np.repeat([0.1, 0.5, 0.05], [7, 3, 3])
    for seed in range(8):
        scene = sample_touch_scene(ARM, seed, 2)
        q = scene.motion.q_start
        torque = true_torque(ARM, scene, q)
        felt = np.concatenate([torque, true_base_wrench(ARM, scene, q)])
        told += is_no_single(SURFACE, [q], [torque], 0.1), is_no_single(SURFACE, [q], [felt], sigma)
    assert told[1] > told[0]


def test_a_wrench_of_zero_rules_the_tool_out():
    _, q, torque, _ = of_one(0)
    both, arm_alone = (belief(SURFACE, [q], [torque], 0.2, prior) for prior in (0.4, 0.0))
    assert_allclose(both.given(~SURFACE.on_tool).probability, arm_alone.probability, atol=1e-4)


def test_nothing_felt_says_nothing_of_arm_or_tool():
    known = belief(SURFACE, [ARM.home], [np.zeros(ARM.n)], 1e3, 0.4)
    assert known.probability[SURFACE.on_tool].sum() == pytest.approx(0.4, abs=0.05)


@pytest.mark.parametrize("seed", range(5))
def test_the_force_at_a_known_place_is_the_one_that_made_the_torque(seed):
    """Where the torques of all joints show it; a force that joints cannot feel stays at what is likely beforehand."""
    touch, q, torque, (origins, rotations) = of_one(seed)
    point, force = touch.in_world(origins, rotations)
    found = force_at(ARM, q, (touch.link, point, rotations[touch.link] @ touch.inwards), torque, 1e-6)
    (J,), _ = jacobians(ARM, q, point[None], np.array([touch.link]))
    assert_allclose(J.T @ found, torque, atol=1e-3 * np.linalg.norm(torque))
    if np.linalg.svd(J)[1].min() > 0.05:
        assert_allclose(found, force, atol=0.05)


@pytest.mark.parametrize("seed", range(5))
def test_a_single_contact_is_explained_by_one(seed):
    _, q, torque, _ = of_one(seed)
    assert not is_no_single(SURFACE, [q], [torque], 0.05)


def test_opposed_contacts_are_not():
    """A couple on the last link and a pull on the first ones: no single force does both."""
    assert any(
        is_no_single(SURFACE, [scene.motion.q_start], [true_torque(ARM, scene, scene.motion.q_start)], 0.01)
        for scene in (sample_touch_scene(ARM, seed, 2) for seed in range(8))
    )


@given(seeds)
def test_covariance_of_a_force_is_wider_along_the_normal(seed):
    normal = np.random.default_rng(seed).normal(size=3)
    normal /= np.linalg.norm(normal)
    (S,) = force_covariance(normal[None], np.array([10.0]))
    assert_allclose(np.linalg.eigvalsh(S), [100.0, 100.0, 900.0])
    assert_allclose(S @ normal, 900.0 * normal)


def test_figures_of_a_point_are_of_the_nearest_true_one():
    true = [(5, np.zeros(3)), (6, np.array([0.0, 0.0, 0.5]))]
    found = point_metrics(np.array([0.0, 0.04, 0.5]), 5, true)
    assert found == {"point_error_cm": pytest.approx(4.0), "within_5_cm": 1.0, "link_right": 1.0}
    assert point_metrics(np.array([0.0, 0.06, 0.0]), 4, true)["within_5_cm"] == 0.0


def test_a_set_holds_a_point_only_on_its_link():
    links, points = np.array([5, 6]), np.array([[0.0, 0.0, 0.02], [0.0, 0.0, 1.0]])
    assert set_metrics(links, points, 0.03, [(5, np.zeros(3))])["in_set"] == 1.0
    assert set_metrics(links, points, 0.03, [(6, np.zeros(3))])["in_set"] == 0.0
    assert set_metrics(links, points, 0.03, [(5, np.zeros(3))])["set_area_cm2"] == pytest.approx(18.0)


@pytest.mark.parametrize(
    ("force", "within", "size_within"), [((0, 0, 11.9), 1, 1), ((0, 0, 12.1), 0, 0), ((0, 10, 0), 0, 1)]
)
def test_a_force_is_right_within_the_larger_of_15_percent_and_2_n(force, within, size_within):
    found = force_metrics(np.array(force, float), np.array([0.0, 0.0, 10.0]))
    assert (found["force_within"], found["force_size_within"]) == (within, size_within)
    assert found["force_error_deg"] == pytest.approx(math.degrees(math.atan2(force[1], force[2])))


def test_the_experiment_counts_its_trials_and_shows_the_limit():
    config, done = ExperimentConfig(("vices", "safe"), trials=2, plants=("real",)), []
    result = localisation(config, done.append)
    assert sum(done) == len(result.trials) == ENTRIES["localisation"].count(config) == 24
    assert {trial.controller for trial in result.trials} == {"safe"}
    one = [trial.metrics for trial in result.trials if not trial.scenario.startswith(TWO)]
    two = [trial.metrics for trial in result.trials if trial.scenario.startswith(TWO)]
    assert (len(one), len(two)) == (16, 8)
    assert sum("base sensor" in trial.scenario for trial in result.trials) == 12
    assert all("limit_in_set" in metrics for metrics in one)
    assert all("within_5_cm" not in metrics and "limit_told" in metrics for metrics in two)
    shown = {key for metrics in one + two for key in metrics if not key.startswith("limit_")}
    assert shown <= {metric.name for metric in METRICS} | {"link", "force_n", "path_cm"}
    beside, by_link = result.tables
    assert {row["contact"] for row in beside.as_records()} == {trial.scenario for trial in result.trials}
    assert sum(row["contacts"] for row in by_link.as_records()) == len(one)
