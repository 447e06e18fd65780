"""Recordings of a real Panda: where they are found, what touched it, and what an estimator made of them.

CONTACTSAFE_REAL_DATA=<folder> python -m tests.real.recordings      prints the figures that the documentation has
"""

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np

from contactsafe import Contact, ContactEstimator, Measurement, robots

TOUCHES = {"a5": 7, "b9": 6, "c5": 5, "d3": 4}
"""Recording → link that is touched."""

_GLOVE_EARLY_S, _GLOVE_S = 0.05, 0.3
"""Before a touch by the glove a contact may be its, and after its end the arm swings back."""


def folder():
    """Give the folder of the recordings, None where there is none."""
    beside = Path(__file__).resolve().parents[3] / "shared" / "data"
    named = Path(os.environ.get("CONTACTSAFE_REAL_DATA", beside))
    return named if (named / "panda_touches.npz").exists() else None


def free_motion():
    """Give the free motion: times (T,), q, qd, torque (T, 7), and what was recorded of it, (T,) bool."""
    data = np.load(folder() / "panda_free_motion.npz")
    return np.arange(len(data["q"])) * 1e-3, data["q"], data["qd"], data["tau_J"], data["seen"].astype(bool)


def touches(name):
    """Give a recording of touches, all in double precision; see the data's own page."""
    data = np.load(folder() / "panda_touches.npz")
    keys = ("t", "q", "qd", "tau_J", "tau_ext", "on_s", "off_s")
    return {key: data[f"{name}_{key}"].astype(float) for key in keys}


class Felt(NamedTuple):
    """What an estimator made of a log.

    Attributes:
        contacts: of every row.
        estimator: as it was in the end.
    """

    contacts: list[Contact]
    estimator: ContactEstimator


def played(arm, t, q, qd, torque, wrench_ee=None, dt=0.001, config=None):
    """Run an estimator over a log."""
    estimator = ContactEstimator(arm, config, dt)
    estimator.reset(q[0])
    rows = zip(t, q, qd, torque, strict=True)
    contacts = [
        estimator.step(Measurement(at, velocity, wrench_ee, float(when), tau)) for when, at, velocity, tau in rows
    ]
    return Felt(contacts, estimator)


def arm_of(recording):
    """Give the arm of a recording: the free motion's has a bare flange, the others a hand."""
    return robots.panda(None) if recording == "free" else robots.panda("hand")


def first_above(shown, log):
    """Tell of each touch how long after its begin something began to show, s; NaN where nothing did.

    What showed before the touch began, and went on, is not it.
    """
    t = log["t"]
    starts = t[np.flatnonzero(shown[1:] & ~shown[:-1]) + 1]
    when = []
    for on, off in zip(log["on_s"], log["off_s"], strict=True):
        during = starts[(starts >= on - _GLOVE_EARLY_S) & (starts <= off)]
        when.append(during[0] - on if len(during) else np.nan)
    return np.array(when)


def found_after(contacts, log):
    """Tell of each touch how long after its begin it was felt, s; NaN where it was not."""
    return first_above(np.array([contact.touched for contact in contacts]), log)


def links_at_their_peak(contacts, log):
    """Name the link of each touch where its torque is largest; 0 where it was not felt."""
    t, named = log["t"], []
    for on, off in zip(log["on_s"], log["off_s"], strict=True):
        during = np.flatnonzero((t >= on) & (t <= off + _GLOVE_S))
        peak = max(during, key=lambda k: np.abs(contacts[k].torque).max())
        named.append(contacts[peak].link)
    return named


def false_starts(contacts, log):
    """Count the touches that begin while the glove touches nothing."""
    t, touched = log["t"], np.array([contact.touched for contact in contacts])
    starts = t[np.flatnonzero(touched[1:] & ~touched[:-1]) + 1]
    near = [np.any((log["on_s"] - 0.1 <= s) & (s <= log["off_s"] + _GLOVE_S)) for s in starts]
    return int(len(starts) - sum(near))


def figures(wrench_ee):
    """Sum up what is felt of all touches: how many, how soon, how often falsely, how many links are right."""
    found, franka, false, right = [], [], 0, 0
    for name, link in TOUCHES.items():
        log = touches(name)
        felt = played(arm_of(name), log["t"], log["q"], log["qd"], log["tau_J"], wrench_ee, 1.0 / 90.0)
        found.append(found_after(felt.contacts, log))
        franka.append(first_above(np.abs(log["tau_ext"]).max(axis=1) > 1.5, log))
        false += false_starts(felt.contacts, log)
        right += sum(named == link for named in links_at_their_peak(felt.contacts, log))
    after, theirs = np.concatenate(found), np.concatenate(franka)
    return (
        f"{np.isfinite(after).sum()} of {len(after)} felt, median {1000 * np.nanmedian(after):.0f} ms "
        f"(Franka's own {1000 * np.nanmedian(theirs):.0f}), {false} false, link right in {right}"
    )


if __name__ == "__main__":
    for named, wrench in (("zero wrench", np.zeros(6)), ("no wrench", None)):
        t, q, qd, torque, _ = free_motion()
        free = played(arm_of("free"), t, q, qd, torque, wrench).contacts
        print(
            f"{named}: {figures(wrench)}; free motion: {sum(contact.touched for contact in free)} of {len(free)} ticks"
        )
