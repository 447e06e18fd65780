"""The wiping task in the second engine: the same task, controller, sensors and camera, physics by PyBullet."""

import numpy as np

from contactsafe.core.compiled import compiled
from contactsafe.policy.action import apply_action
from contactsafe.sim.bullet_worlds import BulletWorlds
from contactsafe.tasks.wiping.env import WipingEnv, WipingVectorEnv
from contactsafe.tasks.wiping.step import judge
from contactsafe.tasks.wiping.tasks import WipingTasks


class BulletTasks(WipingTasks):
    """`WipingTasks` in PyBullet; needs `contactsafe[pybullet]` and takes no obstacles."""

    world_type = BulletWorlds
    varies = False

    def _advance(self, ticks: np.ndarray, traces: np.ndarray) -> None:
        worlds = self.worlds
        _apply(worlds.controllers, self._limits, self._rule, self._actions)
        worlds.enter_changed()
        worlds.run(ticks, traces if traces.shape[1] else None)
        _judge(
            worlds.plants, worlds.controllers, worlds.cells, worlds.reports, worlds.cameras, worlds.ink_index,
            self._rewards[0], self.tasks, worlds.masks,
        )  # fmt: skip
        worlds.in_threads(self._look)


@compiled(nogil=True)
def _apply(controllers, limits, rule, actions):
    for i in range(actions.shape[0]):
        apply_action(controllers[i], limits, rule, actions[i])


@compiled(nogil=True)
def _judge(plants, controllers, cells, reports, cameras, ink_index, rewards, tasks, masks):
    for i in range(tasks.shape[0]):
        judge(i, plants[i], controllers[i], cells[i], reports[i], cameras, ink_index, rewards, tasks[i], masks[i])


class WipingBulletEnv(WipingEnv):
    """`WipingEnv` with physics by PyBullet: `contactsafe/WipingBullet-v0`."""

    task_type = BulletTasks


class WipingBulletVectorEnv(WipingVectorEnv):
    """`WipingVectorEnv` with physics by PyBullet, its boards stepped one after the other."""

    task_type = BulletTasks
