"""Train in a process of its own that is killed amidst it: python -m tests.learning.killed_run (see the end)."""

import os
import pickle
import signal
import sys
from pathlib import Path

from contactsafe.core import files
from contactsafe.learning.checkpoints import CHECKPOINT
from contactsafe.learning.train_policy import train_policy


def dying(make_env, calls):
    """Make environments whose process is killed amidst a call to `step`."""

    def make(num_envs):
        env = make_env(num_envs)
        step, count = env.step, iter(range(calls))

        def step_until(actions):
            if next(count, None) is None:
                os.kill(os.getpid(), signal.SIGKILL)
            return step(actions)

        env.step = step_until
        return env

    return make


def die_while_saving(saves):
    """Have the process killed with a checkpoint half written."""
    replace, count = os.replace, iter(range(saves))

    def replace_half(name, path):
        if Path(path).name == CHECKPOINT and next(count, None) is None:
            os.truncate(name, 1000)
            os.kill(os.getpid(), signal.SIGKILL)
        replace(name, path)

    files.os.replace = replace_half


def main(path):
    """Train as the pickled (config, make_env, calls, saves) at a path says; None for never."""
    config, make_env, calls, saves = pickle.loads(Path(path).read_bytes())
    if saves is not None:
        die_while_saving(saves)
    train_policy(config, make_env if calls is None else dying(make_env, calls))


if __name__ == "__main__":
    main(sys.argv[1])
