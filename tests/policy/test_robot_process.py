"""When the policy acts: at the ticks of its rate, late steps left out, and never once the robot is let go of."""

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.hardware import heartbeats, states
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.mailbox import publish
from contactsafe.hardware.messages import as_words, seen_dtype
from contactsafe.policy import robot_process
from contactsafe.policy.actor import PolicySettings
from contactsafe.policy.bundle import shipped_bundle
from contactsafe.policy.rate import ticks_of_step
from contactsafe.robot import robots
from contactsafe.tasks.insertion.config import InsertionConfig
from contactsafe.tasks.insertion.robot import InsertionWork
from contactsafe.tasks.insertion.scene import PEG


class Clock:
    """A control process that ticks whenever the policy sleeps."""

    def __init__(self, exchange, ticks):
        self.exchange, self.last, self.tick = exchange, ticks, 0
        self.seen = np.zeros(1, seen_dtype(7))

    def sleep(self, seconds):
        """Tick once, and end the run after the last tick."""
        del seconds
        self.tick += 1
        self.seen["tick"] = self.tick
        publish(self.exchange.seen, as_words(self.seen))
        self.exchange.status["finished"] = int(self.tick >= self.last)


class Acts:
    """An actor that notes when it acts, and for how many ticks it is busy."""

    def __init__(self, clock, busy=lambda step: 0, rounds_at=None):
        self.clock, self.busy, self.rounds_at = clock, busy, rounds_at
        self.seen = np.zeros(1, seen_dtype(7))
        self.seen_words, self.ticks, self.done = as_words(self.seen), [], False
        self.settings = PolicySettings(None, None, None)

    def step(self):
        self.ticks.append(int(self.seen["tick"][0]))
        for _ in range(self.busy(len(self.ticks))):
            self.clock.sleep(0.0)
        self.done = len(self.ticks) == self.rounds_at


@pytest.fixture
def exchange():
    made = Exchange.create(7)
    yield made
    made.unlink()


def follow(exchange, monkeypatch, ticks, **options):
    clock = Clock(exchange, ticks)
    actor = Acts(clock, **options)
    monkeypatch.setattr(robot_process.time, "sleep", clock.sleep)
    robot_process._follow(actor, exchange)
    return actor


def starts(count):
    """Give the ticks at which the steps of the policy's rate begin."""
    return [1 + sum(int(ticks_of_step(k)) for k in range(step)) for step in range(count)]


def test_it_acts_sixty_times_a_second_by_the_robots_ticks(exchange, monkeypatch):
    actor = follow(exchange, monkeypatch, 1000)
    assert actor.ticks == starts(60)


def test_a_step_that_came_late_is_left_out_and_not_made_up_for(exchange, monkeypatch):
    """One step that takes 60 ms: the next is the one that is due then, and none follows it at once."""
    actor = follow(exchange, monkeypatch, 500, busy=lambda step: 60 if step == 5 else 0)
    assert actor.ticks[:5] == starts(5)
    late = actor.ticks[5]
    assert late >= actor.ticks[4] + 60
    assert np.diff(actor.ticks[5:]).min() >= 1
    assert set(actor.ticks[6:]) <= set(starts(40))
    assert len(actor.ticks) < 30


def test_it_tells_how_far_it_has_seen_whether_or_not_it_acts(exchange, monkeypatch):
    follow(exchange, monkeypatch, 25)
    assert exchange.status["ready_policy"][0] >= 24


def test_when_its_work_is_done_it_says_so_and_acts_no_more(exchange, monkeypatch):
    actor = follow(exchange, monkeypatch, 1000, rounds_at=7)
    assert len(actor.ticks) == 7
    assert exchange.status["stop"][0] == states.POLICY_DONE


def test_it_ends_with_the_run(exchange, monkeypatch):
    exchange.status["finished"] = 1
    assert follow(exchange, monkeypatch, 1000).ticks == []


def test_it_ends_when_nobody_is_left_who_would_end_the_run(exchange, monkeypatch):
    monkeypatch.setattr(heartbeats, "_ALONE_S", 0.1)
    robot_process._follow(Acts(None), exchange)
    assert exchange.status["finished"][0] == 0


class Blind(InsertionWork):
    """Work that cannot open what it looks with."""

    closed = False

    def prepare(self, arm, lockstep, speed=1.0):
        raise InvalidInputError("no camera is connected; check the cable")

    def close(self):
        type(self).closed = True


@pytest.fixture
def own_signals():
    import signal

    before = signal.getsignal(signal.SIGINT)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("own_signals")
def test_a_policy_that_cannot_begin_says_why_in_one_line_and_ends_the_run(exchange, capfd):
    settings = PolicySettings(robots.fr3(PEG), shipped_bundle("insertion"), Blind(InsertionConfig()))
    robot_process.act_on_robot(str(exchange.path), settings)
    said = capfd.readouterr()
    assert said.out == "policy: no camera is connected; check the cable\n"
    assert said.err == ""
    assert exchange.status["stop"][0] == states.POLICY_DEAD
    assert Blind.closed
