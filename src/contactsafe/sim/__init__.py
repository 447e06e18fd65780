"""Simulated worlds that know no task: fixtures, obstacles, backends, errors of sensors and motors, native stepping."""

from contactsafe.sim.config import NO_NOISE, REAL_SENSORS, PlantConfig, SensorConfig, WorldConfig
from contactsafe.sim.fixtures import Box, Fixture, TipSurface, workbench
from contactsafe.sim.obstacles import Obstacle, bottle, thrust_meter
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import Worlds

__all__ = [
    "NO_NOISE",
    "REAL_SENSORS",
    "Box",
    "Fixture",
    "Obstacle",
    "PlantConfig",
    "SensorConfig",
    "TipSurface",
    "WorldConfig",
    "Worlds",
    "bottle",
    "thrust_meter",
    "trace_dtype",
    "workbench",
]
