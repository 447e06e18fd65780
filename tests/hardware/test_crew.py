"""Processes that come, work and go: what is said of how a run ended."""

import errno
import multiprocessing
import os
import pickle
import signal

import pytest
from tests.hardware import crew_parts

from contactsafe.hardware import crew, states
from contactsafe.hardware.crew import Part, RunError, run_crew
from contactsafe.hardware.ending import ending_of
from contactsafe.hardware.exchange import Exchange


@pytest.fixture
def exchange():
    made = Exchange.create(7)
    yield made
    made.unlink()


@pytest.mark.parametrize(("state", "reason", "number", "well"), [
    (states.STOPPED, states.TIME_UP, 0, True),
    (states.STOPPED, states.ASKED, 0, True),
    (states.STOPPED, states.POLICY_DONE, 0, True),
    (states.STOPPED, states.POLICY_SILENT, 0, False),
    (states.FAULT, states.ROBOT_FAULT, 0, False),
    (states.STOPPED, states.TIME_UP, 28, False),
])  # fmt: skip
def test_a_run_went_well_where_it_stopped_for_a_good_reason_and_was_recorded(exchange, state, reason, number, well):
    exchange.status["state"], exchange.status["reason"], exchange.status["recorder_errno"] = state, reason, number
    ending = ending_of(exchange)
    assert ending.went_well is well
    assert (ending.state, ending.reason) == (states.STATES[state], states.REASONS[reason].name)
    assert bool(ending.remedy) is not well


def test_a_log_that_ends_early_asked_for_more_seconds(exchange):
    exchange.status["state"], exchange.status["reason"] = states.STOPPED, states.TIME_UP
    exchange.status["recorder_errno"] = errno.ENOSPC
    remedy = ending_of(exchange).remedy
    assert "--seconds" not in remedy
    assert remedy == "its log ends early: No space left on device; give it another place"


def test_a_recorder_that_was_killed_was_a_success(exchange):
    status = exchange.status
    status["state"], status["reason"], status["pid_recorder"] = states.STOPPED, states.TIME_UP, 1
    status["rows"], status["recorded"], status["dropped"] = 1001, 601, 100
    ending = ending_of(exchange)
    assert not ending.went_well
    assert ending.remedy == "its log ends early: the recorder was ended; see what ended it"
    assert ending.recorded == 500
    status["recorded"] = 1001
    assert ending_of(exchange).went_well


def test_the_busy_time_is_told_by_its_distribution(exchange):
    exchange.status["busy"][0, [30, 100, 700]] = [980, 15, 5]
    assert ending_of(exchange).busy_us == (30, 100, 700, 5)
    assert ending_of(exchange).busy_ticks[-1] == 5
    assert sum(ending_of(exchange).busy_ticks) == exchange.status["busy"].sum()


def test_a_run_in_which_all_do_their_part_ends_well_and_leaves_nothing(exchange):
    looks = []
    parts = [Part("control", crew_parts.control), Part("policy", crew_parts.policy), Part("watchdog", crew_parts.dog)]
    ending = run_crew(exchange, parts, 0.3, lambda status: looks.append(int(status["tick"])))
    assert ending.went_well
    assert ending.reason == "time is up"
    assert looks
    assert not exchange.path.exists()


def test_a_terminal_that_was_closed_took_the_control_loop_with_it(exchange):
    looks, before = [], signal.signal(signal.SIGHUP, signal.SIG_DFL)  # whoever runs the tests may be under nohup

    def close_terminal(status):
        if not looks:
            for pid in [os.getpid(), *(child.pid for child in multiprocessing.active_children())]:
                os.kill(pid, signal.SIGHUP)
        looks.append(int(status["tick"]))

    parts = [Part("control", crew_parts.control), Part("policy", crew_parts.policy), Part("watchdog", crew_parts.dog)]
    try:
        ending = run_crew(exchange, parts, 30.0, close_terminal)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert ending.went_well
    assert ending.reason == "asked to stop"


def test_a_part_that_does_not_get_ready_is_named_and_the_others_end(exchange):
    parts = [Part("control", crew_parts.control), Part("policy", crew_parts.fails), Part("watchdog", crew_parts.dog)]
    with pytest.raises(RunError, match="policy process did not get ready"):
        run_crew(exchange, parts, 1.0)
    assert not exchange.path.exists()


def test_the_policy_that_failed_is_named_and_not_who_ended_for_its_sake(exchange):
    parts = [
        Part("control", crew_parts.stops),
        Part("policy", crew_parts.asks_to_stop),
        Part("watchdog", crew_parts.dog),
    ]
    with pytest.raises(RunError, match="policy process did not get ready"):
        run_crew(exchange, parts, 1.0)


def test_a_part_that_cannot_be_started_says_why_and_leaves_nothing(exchange):
    parts = [Part("control", crew_parts.control), Part("policy", crew_parts.policy, (lambda: None,))]
    with pytest.raises((AttributeError, TypeError, pickle.PicklingError), match=r"(?i)pickle|local"):
        run_crew(exchange, parts, 1.0)
    assert not exchange.path.exists()
    assert not multiprocessing.active_children()


def test_who_does_not_end_is_ended(exchange, monkeypatch):
    monkeypatch.setattr(crew, "_SEE_OFF_S", 0.5)
    parts = [Part("control", crew_parts.control), Part("policy", crew_parts.stays)]
    ending = run_crew(exchange, parts, 0.2)
    assert ending.state == "stopped"
    assert not multiprocessing.active_children()
