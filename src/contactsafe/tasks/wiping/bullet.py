"""The wiping task in the second engine: the same task, controller, sensors and camera, physics by PyBullet."""

from contactsafe.sim.bullet_backend import BulletBackend
from contactsafe.tasks.wiping.env import WipingEnv, WipingVectorEnv
from contactsafe.tasks.wiping.tasks import WipingTasks


class BulletTasks(WipingTasks):
    """`WipingTasks` in PyBullet; needs `contactsafe[pybullet]` and takes no obstacles."""

    backend = BulletBackend
    varies = False


class WipingBulletEnv(WipingEnv):
    """`WipingEnv` with physics by PyBullet: `contactsafe/WipingBullet-v0`."""

    task_type = BulletTasks


class WipingBulletVectorEnv(WipingVectorEnv):
    """`WipingVectorEnv` with physics by PyBullet, its boards stepped one after the other."""

    task_type = BulletTasks
