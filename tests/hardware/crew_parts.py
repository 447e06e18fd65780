"""Processes for `test_crew`: each does as little of its part as a run needs."""

import signal
import time

from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.states import RUNNING, STOPPED, TIME_UP


def control(path):
    """Tick a thousand times a second until the run is to end."""
    exchange = Exchange(path)
    board = exchange.board
    while not board["go"][0] and not board["finished"][0]:
        board["beat_control"] += 1
        time.sleep(0.001)
    board["state"] = RUNNING
    while not board["stop"][0] and not board["finished"][0]:
        board["beat_control"] += 1
        board["tick"] += 1
        time.sleep(0.001)
        if 0 < board["last_tick"][0] <= board["tick"][0]:
            exchange.ask_to_stop(TIME_UP)
    board["state"], board["reason"], board["finished"] = STOPPED, board["stop"], 1


def policy(path):
    """Be ready, and end with the run."""
    exchange = Exchange(path)
    exchange.board["beat_policy"] += 1
    while not exchange.board["finished"][0]:
        time.sleep(0.005)


def dog(path):
    """Beat until the run is over."""
    exchange = Exchange(path)
    while not exchange.board["finished"][0]:
        exchange.board["beat_watchdog"] += 1
        time.sleep(0.005)


def fails(path):
    """End before anything was ready."""
    del path


def stays(path):
    """Be ready, and never end by itself."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    exchange = Exchange(path)
    exchange.board["beat_policy"] += 1
    time.sleep(60.0)
