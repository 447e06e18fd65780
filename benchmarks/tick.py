"""Time of one control tick, in free motion and in contact: replays a recorded collision through the compiled tick.

    python benchmarks/tick.py            records a collision where `collision.npz` does not exist, then times it
    PYTHONPATH=<other checkout>/src python benchmarks/tick.py collision.npz      times another version on the same data

Machines differ and are shared: run the versions to be compared one after the other, several times, and quote ratios.
"""

import sys
import time
from pathlib import Path

import numpy as np

import contactsafe as cs
from contactsafe.control.tick import control_tick
from contactsafe.core.compiled import compiled

REPEATS = 9
AFTER = 800  # ticks in contact


@compiled
def replay(controllers, q, qd, wrench, torque, modes):
    c = controllers[0]
    for k in range(q.shape[0]):
        c.measurement.q[:] = q[k]
        c.measurement.qd[:] = qd[k]
        c.measurement.wrench_ee[:] = wrench[k]
        c.measurement.has_wrench = 1
        if k > 0:
            c.state.command.tau[:] = torque[k - 1]  # the residual is that of the recording
        control_tick(c)
        modes[k] = c.output.mode


def record(path: Path) -> None:
    """Record a sweep into an obstacle and what follows."""
    from contactsafe.experiments.collision_motions import sample_motion
    from contactsafe.experiments.collision_scenes import sample_meetings
    from contactsafe.experiments.motions import record as run
    from contactsafe.sim.worlds import Worlds

    arm, seed, contact = cs.robots.panda(), 0, False
    while not contact:
        motion = sample_motion(arm, seed)
        free = _run(arm, motion, (), run, Worlds)
        met = _run(arm, motion, sample_meetings(arm, motion, free["q"]), run, Worlds)
        contact = not motion.holds and (met["mode"][-AFTER:] > 0).all()
        seed += 1
    qd = np.gradient(met["q"], 0.001, axis=0)
    np.savez(path, q=met["q"], qd=qd, wrench=met["wrench_ee"], torque=met["torque"])


def _run(arm, motion, met, run, Worlds):
    from contactsafe.sim.config import REAL_SENSORS

    config = motion.world(tuple(meeting.obstacle for meeting in met), REAL_SENSORS)
    worlds = Worlds(arm, [config], cs.presets.safe(), 1, [motion.seed])
    traces = run(worlds, [motion])
    worlds.close()
    return traces[0]


def main() -> None:
    """Time the tick on a recording."""
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "collision.npz")
    if not path.exists():
        record(path)
    data = np.load(path)
    arrays = [np.ascontiguousarray(data[name]) for name in ("q", "qd", "wrench", "torque")]
    controller = cs.Controller(cs.robots.panda(), cs.presets.safe())
    modes = np.zeros(len(arrays[0]), int)
    controller.reset(arrays[0][0])
    replay(controller._records, *arrays, modes)
    contact = np.flatnonzero(modes)
    parts = {
        "free": slice(0, contact[0]),
        "found": slice(contact[0], contact[0] + 1),
        "contact": slice(contact[0] + 1, contact[0] + AFTER),
    }
    best = dict.fromkeys(parts, np.inf)
    for _ in range(REPEATS):
        controller.reset(arrays[0][0])
        for name, part in parts.items():
            begin = time.thread_time()
            replay(controller._records, *[a[part] for a in arrays], modes[part])
            best[name] = min(best[name], (time.thread_time() - begin) / len(modes[part]))
    for name, seconds in best.items():
        print(f"{name:8s} {1e6 * seconds:6.2f} us/tick over {len(modes[parts[name]])} ticks, best of {REPEATS}")
    print(f"in contact in {100 * (modes[parts['contact']] > 0).mean():.0f} % of the second part")


if __name__ == "__main__":
    main()
