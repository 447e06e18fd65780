"""The controller says where it is touched, how hard, and what else explains its torques, while it reacts."""

import numpy as np
import pytest
from tests.control.plant import UNTOUCHED, Plant, controller_at, hold

from contactsafe import presets, robots

FORCE = np.array([0.0, 30.0, 0.0])


@pytest.fixture(scope="module")
def arm():
    return robots.panda()


def pushed(arm, config, link=5, ticks=300):
    """Hold the arm, then push it; give controller, plant, and the outputs from the push on."""
    plant, controller, seen = Plant(arm), controller_at(arm, config), []
    plant.run(controller, hold(arm), 1000, UNTOUCHED)
    plant.push(f"link{link}", FORCE)
    plant.run(controller, hold(arm), ticks, UNTOUCHED, seen.append)
    return controller, plant, seen


@pytest.mark.parametrize("link", [4, 5])
def test_a_contact_named_a_link_and_no_place(arm, link):
    controller, plant, seen = pushed(arm, presets.safe(), link)
    contact = seen[-1].contact
    assert contact.in_contact
    assert abs(contact.link - link) <= 1
    assert np.linalg.norm(contact.point - plant.data.body(f"link{link}").xipos) < 0.15
    assert contact.force @ FORCE / 30.0 == pytest.approx(30.0, rel=0.4)
    assert 0.5 < contact.probability <= 1.0
    places = controller.places()
    assert sum(place.probability for place in places) >= 0.95
    assert min(np.linalg.norm(place.point - contact.point) for place in places) < 0.1


def test_an_untouched_arm_has_no_place(arm):
    plant, controller = Plant(arm), controller_at(arm, presets.safe())
    contact = plant.run(controller, hold(arm), 300, UNTOUCHED).contact
    assert (contact.kind, contact.link, contact.probability) == ("none", 0, 1.0)
    assert np.isnan(contact.point).all()
    assert not contact.force.any()
    assert controller.places() == []


def test_a_contact_that_is_over_leaves_no_place(arm):
    controller, plant, _ = pushed(arm, presets.safe())
    plant.push("link5", np.zeros(3))
    contact = plant.run(controller, hold(arm), 1500, UNTOUCHED).contact
    assert np.isnan(contact.point).all()
    assert controller.places() == []


def test_a_controller_that_is_blind_to_contact_has_no_place(arm):
    _, _, seen = pushed(arm, presets.vices())
    assert all(np.isnan(out.contact.point).all() for out in seen)


def test_where_an_arm_is_touched_does_not_change_what_it_does(arm):
    """No torque depends on the place: an arm whose surface is not known is commanded the same."""
    _, _, seen = pushed(arm, presets.safe())
    blind, plant, again = controller_at(arm, presets.safe()), Plant(arm), []
    blind.record["handle"]["place_points"] = 0
    plant.run(blind, hold(arm), 1000, UNTOUCHED)
    plant.push("link5", FORCE)
    plant.run(blind, hold(arm), 300, UNTOUCHED, again.append)
    assert all((one.torque == other.torque).all() for one, other in zip(seen, again, strict=True))
