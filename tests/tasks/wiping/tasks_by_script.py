"""Scripted policies for the wiping task: what a learner might fall for, and what it should find."""

import numpy as np

from contactsafe.tasks.wiping.tasks import WipingTasks
from contactsafe.tasks.wiping.whiteboard import INK


def episode(config, script, n=4, seed=0, steps=None, drawing=None):
    """Run n boards under a script until each ends; returns (n,), tasks, and every step's reward terms."""
    tasks = WipingTasks(config, n, seed)
    for i in range(n):
        tasks.reset(i, np.random.default_rng(seed + i), drawing=drawing)
    running, returns, terms = np.ones(n, bool), np.zeros(n), []
    for step in range(steps or tasks.step_limit):
        tasks.step(script(tasks, step))
        returns += np.where(running, tasks.reward, 0.0)
        terms.append(tasks.tasks["reward"].copy())
        running &= ~(tasks.terminated | tasks.truncated)
        if not running.any():
            break
    tasks.worlds.close()
    return returns, tasks, np.array(terms)


def idle(tasks, step):
    """Do nothing: hover where the episode began."""
    return np.zeros((tasks.worlds.n, 18))


def press(tasks, step, depth=0.004):
    """Go down and lean on the board without moving along it."""
    action = idle(tasks, step)
    action[:, 2] = _down(tasks, depth)
    return action


def circle_near_ink(tasks, step):
    """Swing to and fro above the ink, coming nearer and going away again."""
    action = idle(tasks, step)
    action[:, 1] = 1.0 if (step // 15) % 2 else -1.0
    return action


def wipe_nearest(tasks, step, depth=0.004):
    """Press, and head for the nearest ink, over its far edge."""
    action = press(tasks, step, depth)
    for i in range(tasks.worlds.n):
        ink = np.argwhere(tasks.boards.cells[i] == INK)
        if len(ink) == 0:
            continue
        record = tasks.worlds.controllers[i]
        places = tasks.boards.boards[i].origin + (ink + 0.5) * 0.002
        away = places - record["output"]["position"][:2]
        goal = places[np.argmin(np.linalg.norm(away, axis=1))]
        error = goal - record["output"]["position"][:2]
        beyond = record["output"]["position"][:2] + error * (1.0 + 0.04 / max(np.linalg.norm(error), 1e-3))
        action[i, :2] = (beyond - record["target"]["position"][:2]) / tasks.config.action.translation[0]
    return np.clip(action, -1.0, 1.0)


def _down(tasks, depth):
    z = tasks.worlds.controllers["target"]["position"][:, 2]
    goal = tasks.config.board.centre[2] - depth
    return np.clip((goal - z) / tasks.config.action.translation[2], -1.0, 1.0)
