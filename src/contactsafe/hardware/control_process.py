"""The control process of a run: it takes the robot over, controls it, and lets go of it, whatever happens."""

import os
import time

from contactsafe.core.errors import ContactSafeError
from contactsafe.hardware import realtime
from contactsafe.hardware.control_loop import ControlLoop, ControlSettings
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.port import RobotError
from contactsafe.hardware.states import FAULT, IDLE, ROBOT_FAULT, ROBOT_SILENT, RUNNING, STOPPED, STOPPING


def control(exchange_path: str, settings: ControlSettings) -> None:
    """Be the control process of a run.

    Args:
        exchange_path: of its shared memory.
        settings: as given.
    """
    exchange = Exchange(exchange_path)
    status = exchange.status
    status["pid_control"] = os.getpid()
    try:
        loop = ControlLoop(settings, exchange)
        for line in realtime.apply(settings.rights):
            print(line, flush=True)
        settings.port.connect()
        status["beat_control"] += 1
        while not status["go"][0]:
            if status["stop"][0]:
                return
            status["beat_control"] += 1
            time.sleep(0.002)
        loop.run()
        if status["state"][0] == STOPPING:
            status["state"] = STOPPED
    except RobotError as error:
        silent = "timeout" in str(error).lower() or "network" in str(error).lower() or "udp" in str(error).lower()
        status["state"], status["reason"] = FAULT, ROBOT_SILENT if silent else ROBOT_FAULT
        print(f"robot: {error}", flush=True)
    except ContactSafeError as error:
        status["state"], status["reason"] = FAULT, ROBOT_FAULT
        print(f"control: {error}", flush=True)
    finally:
        if status["state"][0] in (IDLE, RUNNING):
            status["state"] = STOPPED
        status["finished"] = 1
        settings.port.close()
