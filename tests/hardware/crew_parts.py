"""Processes for `test_crew`: each does as little of its part as a run needs."""

import os
import signal
import time

import numpy as np

from contactsafe.core.process import ignore_terminal
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.mailbox import publish, receive
from contactsafe.hardware.messages import as_words, message_dtype, seen_dtype
from contactsafe.hardware.states import POLICY_DEAD, RUNNING, STOPPED, TIME_UP


def control(path):
    """Tick a thousand times a second until the run is to end."""
    ignore_terminal()
    exchange = Exchange(path)
    status = exchange.status
    while not status["go"][0] and not status["finished"][0]:
        status["beat_control"] += 1
        time.sleep(0.001)
    status["state"] = RUNNING
    while not status["stop"][0] and not status["finished"][0]:
        status["beat_control"] += 1
        status["tick"] += 1
        time.sleep(0.001)
        if 0 < status["last_tick"][0] <= status["tick"][0]:
            exchange.ask_to_stop(TIME_UP)
    status["state"], status["reason"], status["finished"] = STOPPED, status["stop"], 1


def policy(path):
    """Be ready, and end with the run."""
    ignore_terminal()
    exchange = Exchange(path)
    exchange.status["beat_policy"] += 1
    while not exchange.status["finished"][0]:
        time.sleep(0.005)


def dog(path):
    """Beat until the run is over."""
    ignore_terminal()
    exchange = Exchange(path)
    while not exchange.status["finished"][0]:
        exchange.status["beat_watchdog"] += 1
        time.sleep(0.005)


def fails(path):
    """End before anything was ready."""
    del path


def stops(path):
    """End before anything was ready, because somebody asks to stop."""
    exchange = Exchange(path)
    while not exchange.status["stop"][0]:
        time.sleep(0.001)


def asks_to_stop(path):
    """Fail to get ready: ask to stop, and end a little later."""
    Exchange(path).ask_to_stop(POLICY_DEAD)
    time.sleep(0.3)


def stays(path):
    """Be ready, and never end by itself."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    exchange = Exchange(path)
    exchange.status["beat_policy"] += 1
    time.sleep(60.0)


def holder(path, position, quat, posture):
    """Ask for one pose at every tick, tick by tick, as a policy in lockstep does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    exchange = Exchange(path)
    status, seen, message = exchange.status, np.zeros(1, seen_dtype(7)), np.zeros(1, message_dtype(7))
    status["pid_policy"] = os.getpid()
    row = message[0]
    row["position"], row["quat"], row["q_posture"], row["joints"] = position, quat, posture, 7
    row["K_task"], row["D_task"] = [150.0] * 3 + [450.0] * 3, [24.0] * 3 + [42.0] * 3
    status["beat_policy"] += 1
    while not status["finished"][0]:
        if receive(exchange.seen, as_words(seen)) > 0 and seen["tick"][0] > row["of_tick"]:
            row["number"], row["of_tick"] = row["number"] + 1, seen["tick"][0]
            publish(exchange.targets, as_words(message))
            status["ready_policy"] = row["of_tick"]
        time.sleep(0)
