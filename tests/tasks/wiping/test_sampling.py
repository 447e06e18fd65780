"""Masks that a vision encoder is trained on: as episodes show them, and the same again from the same seed."""

import numpy as np
import pytest

from contactsafe.tasks import task_by_name


@pytest.fixture(scope="module")
def sampler():
    return task_by_name("wiping").mask_sampler()


def test_masks_hold_ink_and_nothing_else_and_mostly_some(sampler):
    masks, tools = sampler.sample(12, 0)
    assert masks.dtype == np.uint8
    assert masks.shape[0] == len(tools) == 12
    assert set(np.unique(masks)) == {0, 255}
    assert np.isfinite(tools).all()


def test_the_same_seed_draws_the_same_and_another_does_not(sampler):
    first, again, other = sampler.sample(3, 5), sampler.sample(3, 5), sampler.sample(3, 6)
    for one, two in zip(first, again, strict=True):
        np.testing.assert_array_equal(one, two)
    assert not np.array_equal(first[1], other[1])


def test_tools_are_within_reach_of_the_ink_area_and_in_view(sampler):
    _, tools = sampler.sample(20, 1)
    board = task_by_name("wiping").config().board
    assert np.abs(tools[:, :2] - board.centre[:2]).max() <= board.ink_size / 2 + 0.05
    assert (tools[:, 2] >= board.centre[2]).all()
    seen = np.column_stack([tools[:, :2], np.ones(20)]) @ np.asarray(sampler.homography).T
    assert np.isfinite(seen[:, :2] / seen[:, 2:]).all()
