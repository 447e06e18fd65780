"""What a network gets: the chosen vectors in their order, then the latent, each at its stated scale, within bounds."""

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.policy.action_config import ActionConfig
from contactsafe.policy.observation import MIN_STD, Observation, ObservationScaling, chosen, target_observation

A = Observation("a", (1.0, 2.0), (0.5, 4.0))
B = Observation("b", (0.0,), (10.0,))


@pytest.mark.parametrize(
    ("centre", "scale"), [((), ()), ((0.0,), (1.0, 1.0)), ((0.0,), (0.0,)), ((0.0,), (-1.0,)), ((0.0,), (np.nan,))]
)
def test_a_vector_without_a_positive_scale_for_each_number_is_refused(centre, scale):
    with pytest.raises(InvalidInputError, match="observation 'a' has"):
        Observation("a", centre, scale)


def test_vectors_come_in_the_order_of_their_names_and_all_where_none_is_named():
    assert chosen((A, B), ()) == (A, B)
    assert chosen((A, B), ["b", "a"]) == (B, A)
    assert chosen((A, B), ["b"]) == (B,)


@pytest.mark.parametrize("names", [["c"], ["a", "a"], ["a", ""]])
def test_names_that_are_unknown_or_stand_twice_are_refused(names):
    with pytest.raises(InvalidInputError, match="give some of a, b, each once"):
        chosen((A, B), names)


def test_the_centre_becomes_zero_and_one_scale_away_becomes_one():
    scaling = ObservationScaling.from_statistics((A, B), [5.0], [2.0])
    at_centre = {"a": np.array([A.centre]), "b": np.array([B.centre])}
    np.testing.assert_allclose(scaling(at_centre, np.array([[5.0]])), np.zeros((1, 4)), atol=1e-6)
    one_away = {v.name: np.array([np.add(v.centre, v.scale)]) for v in (A, B)}
    np.testing.assert_allclose(scaling(one_away, np.array([[7.0]])), np.ones((1, 4)), atol=1e-6)


def test_nothing_is_beyond_the_clip_and_the_type_is_that_of_networks():
    scaling = ObservationScaling.from_statistics((A,), clip=3.0)
    scaled = scaling({"a": np.array([[1e9, -1e9]])}, np.empty((1, 0)))
    np.testing.assert_array_equal(scaled, [[3.0, -3.0]])
    assert scaled.dtype == np.float32


def test_a_latent_number_that_hardly_moves_is_not_blown_up_to_noise():
    scaling = ObservationScaling.from_statistics((B,), [0.0, 0.0], [1e-9, 3.0])
    assert scaling.scale == (10.0, MIN_STD, 3.0)


def test_the_scaling_as_plain_values_says_all_of_it():
    scaling = ObservationScaling.from_statistics((A, B), [5.0], [2.0], clip=4.0)
    assert ObservationScaling(scaling.observes, **scaling.as_dict()) == ObservationScaling(
        ("a", "b"), [1.0, 2.0, 0.0, 5.0], [0.5, 4.0, 10.0, 2.0], 4.0
    )


def test_the_ends_of_the_gains_ranges_are_observed_as_one():
    config = ActionConfig()
    target, offset = target_observation(config), np.zeros(6)
    scaling = ObservationScaling.from_statistics((target,))
    for sign, stiffness, damping in (
        (-1.0, config.stiffness_low, config.damping_low),
        (1.0, config.stiffness_high, config.damping_high),
    ):
        scaled = scaling({"target": np.array([[*offset, *stiffness, *damping]])}, np.empty((1, 0)))
        np.testing.assert_allclose(scaled[0], [*offset, *12 * [sign]], atol=1e-6)
