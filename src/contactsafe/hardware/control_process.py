"""The control process of a run: it takes the robot over, controls it, and lets go of it, whatever happens."""

import os
import signal
import time
import traceback

from contactsafe.core.errors import ContactSafeError
from contactsafe.core.process import ignore_terminal
from contactsafe.hardware import realtime
from contactsafe.hardware.control_loop import ControlLoop, ControlSettings
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.heartbeats import Heartbeats
from contactsafe.hardware.port import RobotError, RobotSilentError
from contactsafe.hardware.states import (
    ASKED,
    COMMAND_DEAD,
    CONTROL_DEAD,
    FAULT,
    IDLE,
    ROBOT_FAULT,
    ROBOT_SILENT,
    STOPPED,
    STOPPING,
)


def control(exchange_path: str, settings: ControlSettings) -> None:
    """Be the control process of a run.

    Args:
        exchange_path: of its shared memory.
        settings: as given.
    """
    exchange = Exchange(exchange_path)
    status = exchange.status
    ignore_terminal()
    signal.signal(signal.SIGTERM, lambda *_: exchange.ask_to_stop(ASKED))
    status["pid_control"] = os.getpid()
    try:
        _control(exchange, settings)
        status["state"] = STOPPED if status["state"][0] in (IDLE, STOPPING) else status["state"]
    except RobotError as error:
        silent = isinstance(error, RobotSilentError)
        _fail(exchange, ROBOT_SILENT if silent else ROBOT_FAULT)
        names = "" if silent or error.names else ", ".join(settings.port.errors())
        print(f"robot: {error}{f' ({names})' if names else ''}", flush=True)
    except ContactSafeError as error:
        _fail(exchange, CONTROL_DEAD)
        print(f"control: {error}", flush=True)
    except Exception:
        _fail(exchange, CONTROL_DEAD)
        traceback.print_exc()
    finally:
        status["finished"] = 1
        settings.port.close()


def _control(exchange: Exchange, settings: ControlSettings) -> None:
    """Get ready, wait for the others, and control the robot until the run ends."""
    status, loop = exchange.status, ControlLoop(settings, exchange)
    for line in realtime.apply(settings.rights):
        print(line, flush=True)
    settings.port.connect()
    status["beat_control"] += 1
    heartbeats = Heartbeats(status)
    while not status["go"][0]:
        if heartbeats.have_stopped():
            exchange.ask_to_stop(COMMAND_DEAD)
        if status["stop"][0]:
            return
        status["beat_control"] += 1
        time.sleep(0.002)
    loop.run()


def _fail(exchange: Exchange, reason: int) -> None:
    exchange.status["state"], exchange.status["reason"] = FAULT, reason
