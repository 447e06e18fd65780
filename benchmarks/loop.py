"""What a turn of the robot's control loop costs on this machine, and how long the machine itself is away.

    python benchmarks/loop.py
    python benchmarks/loop.py --seconds 600

A turn is timed back to back, and once a millisecond as on a robot, asleep or awake in between: what it needs from
caches is gone by then, though nothing else of this program runs. Then a process of highest priority does nothing but
look at the clock, for as long in each millisecond as a tick is busy: gaps between two looks are time that system or
hypervisor took, and no program on this machine is spared them.
"""

import argparse
import gc
import os
import time
from collections.abc import Callable

import numpy as np

PRIORITY = 80  # of SCHED_FIFO, as the control process asks for
PERIOD_NS, BUSY_NS = 1_000_000, 75_000
BOUNDS_US = (100, 250, 425)  # the last one brings a tick that is busy for 75 µs to half a millisecond
TURNS = 5000


def turns_us(pause: Callable[[], None]) -> np.ndarray:
    """Return the time of each turn of an arm that is held, µs."""
    import contactsafe as cs
    from contactsafe.hardware.control_loop import ControlLoop, ControlSettings
    from contactsafe.hardware.exchange import Exchange
    from contactsafe.hardware.franka_port import FrankaPort
    from contactsafe.hardware.loop import turn
    from contactsafe.hardware.mailbox import publish
    from contactsafe.hardware.messages import as_words, message_dtype
    from contactsafe.hardware.states import RUNNING

    arm = cs.robots.fr3("wiper")
    exchange, message = Exchange.create(arm.n), np.zeros(1, message_dtype(arm.n))
    pose = arm.tool_pose(arm.home)
    message["position"], message["quat"], message["q_posture"], message["joints"] = *pose, arm.home, arm.n
    message["K_task"], message["D_task"] = [150.0] * 3 + [450.0] * 3, [24.0] * 3 + [42.0] * 3
    try:
        loop = ControlLoop(ControlSettings(arm, cs.presets.safe(), FrankaPort("127.0.0.1")), exchange)
        spent = np.zeros(TURNS)
        for k in range(TURNS):
            loop._reading["time"] += 0.001
            exchange.status["beat_watchdog"] += 1
            if k % 16 == 1:
                message["number"], message["of_tick"] = k, exchange.status["tick"]
                publish(exchange.targets, as_words(message))
            pause()
            began = time.perf_counter_ns()
            turn(*loop._arguments)
            spent[k] = (time.perf_counter_ns() - began) / 1000.0
        assert exchange.status["state"][0] == RUNNING
    finally:
        exchange.unlink()
    return spent[TURNS // 10 :]


def awake() -> None:
    """Look at the clock for eight tenths of a millisecond."""
    until = time.perf_counter_ns() + 800_000
    while time.perf_counter_ns() < until:
        pass


def gaps_us(seconds: float) -> np.ndarray:
    """Return the longest gap within each millisecond's looks, µs."""
    clock, gaps = time.perf_counter_ns, [0] * round(1000 * seconds)
    due = clock()
    for k in range(len(gaps)):
        due = max(due + PERIOD_NS, clock() - PERIOD_NS)
        time.sleep(max(due - clock(), 0) / 1e9)
        last = clock()
        until, longest = last + BUSY_NS, 0
        while last < until:
            now = clock()
            longest = max(longest, now - last)
            last = now
        gaps[k] = longest
    return np.array(gaps) / 1000.0


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="What a turn of the robot's loop costs, and what the machine takes.")
    parser.add_argument("--seconds", type=float, default=60.0, help="of looking at the clock")
    seconds = parser.parse_args().seconds
    pauses = {"back to back": lambda: None, "asleep for 0.8 ms": lambda: time.sleep(0.0008), "awake for 0.8 ms": awake}
    gc.disable()
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except PermissionError:
        print("the system does not grant SCHED_FIFO: other processes count as well")
    for name, pause in pauses.items():
        median, most = np.percentile(turns_us(pause), [50, 99])
        print(f"a turn, {name}: median {median:.1f} µs, 99 % {most:.1f} µs")
    gaps = gaps_us(seconds)
    print(f"{len(gaps)} milliseconds, looks at the clock for {BUSY_NS // 1000} µs of each:")
    median, most = np.percentile(gaps, [50, 99])
    print(f"longest gap: median {median:.1f} µs, 99 % {most:.1f} µs, longest of all {gaps.max():.0f} µs")
    for bound in BOUNDS_US:
        print(f"over {bound} µs: {np.count_nonzero(gaps > bound)}")


if __name__ == "__main__":
    main()
