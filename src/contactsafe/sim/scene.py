"""MJCF of a world: the arm's body tree, fixtures, obstacles on springs, and the sensors that watch them."""

import math
import xml.etree.ElementTree as ET
from dataclasses import replace
from typing import Any

import mujoco

from contactsafe.core.errors import InvalidInputError, UnsupportedVersionError
from contactsafe.robot.arm import Arm, description_and_tool
from contactsafe.robot.description import ArmDescription, Inertia, Tool
from contactsafe.robot.mjcf import FLANGE_SITE, TIP_GEOM, arm_body, model_root, numbers
from contactsafe.sim.config import PlantConfig, WorldConfig, per_joint
from contactsafe.sim.fixtures import Fixture
from contactsafe.sim.obstacles import Obstacle


def build_plant(arm: Arm, config: WorldConfig) -> mujoco.MjModel:
    """Compile the world around an arm that has a description.

    Raises:
        InvalidInputError: the arm has no description to build a plant from.
        UnsupportedVersionError: this MuJoCo has no contact sensors.
    """
    if not hasattr(mujoco.mjtSensor, "mjSENS_CONTACT"):
        raise UnsupportedVersionError(
            f"mujoco {mujoco.__version__} has no contact sensors, which simulated worlds and tasks need; a controller "
            "in a scene of your own runs on it; run: pip install 'mujoco>=3.3.5'"
        )
    return mujoco.MjModel.from_xml_string(scene_mjcf(arm, config))


def build_plants(arm: Arm, configs: list[WorldConfig], shared: bool) -> list[mujoco.MjModel]:
    """Compile a model for each configuration, equal ones once, but for obstacles that travel: those move the model."""
    known: dict[WorldConfig, mujoco.MjModel] = {}
    models = []
    for config in configs:
        own = not shared or any(any(obstacle.travel) for obstacle in config.obstacles)
        if own or config not in known:
            models.append(build_plant(arm, config))
            known.setdefault(config, models[-1])
        else:
            models.append(known[config])
    return models


def scene_mjcf(arm: Arm, config: WorldConfig) -> str:
    """Write the MJCF of the world around an arm."""
    description, tool = description_and_tool(arm)
    root = model_root("contactsafe world")
    for option in root.iter("option"):
        option.set("gravity", numbers(arm.model.opt.gravity))
    _visual(root)
    world = ET.SubElement(root, "worldbody")
    ET.SubElement(world, "light", pos="0.6 -0.6 2", dir="0 0.3 -1", diffuse="0.7 0.7 0.7")
    for fixture in config.fixtures:
        _fixture(world, fixture)
    world.append(arm_body(perturbed(description, config.plant), loaded(tool, config.plant)))
    for index, obstacle in enumerate(config.obstacles):
        _obstacle(world, index, obstacle)
    tool_body = next(body for body in world.iter("body") if body.get("name") == "tool")
    ET.SubElement(tool_body, "site", name="tool_com", pos=numbers(tool.inertia.com))
    if tool.tip is not None:
        tip = next(geom for geom in tool_body.iter("geom") if geom.get("name") == TIP_GEOM)
        tip.set("solref", numbers(config.tip.solref))
        tip.set("solimp", numbers(config.tip.solimp))
        tip.set("priority", "1")
        tip.set("friction", numbers((config.tip.friction, 0.005, 0.0001)))
    actuator = ET.SubElement(root, "actuator")
    for index in range(1, arm.n + 1):
        ET.SubElement(actuator, "motor", name=f"motor{index}", joint=f"joint{index}")
    _sensors(root, tool, config)
    if config.sensors.base:
        _base_sensor(root)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode")


def perturbed(description: ArmDescription, plant: PlantConfig) -> ArmDescription:
    """Return the description of an arm whose inertias differ from what the controller believes."""
    scales = per_joint(plant.inertia_scale, len(description.links), "inertia_scale")
    links = tuple(
        replace(link, inertia=_scaled(link.inertia, float(scale)))
        for link, scale in zip(description.links, scales, strict=True)
    )
    return replace(description, links=links)


def _scaled(inertia: Inertia, scale: float) -> Inertia:
    tensor = tuple(scale * value for value in inertia.tensor)
    return replace(inertia, mass=scale * inertia.mass, tensor=tensor)  # type: ignore[arg-type]


def loaded(tool: Tool, plant: PlantConfig) -> Tool:
    """Return a tool with the payload that the controller does not know of.

    Raises:
        InvalidInputError: the payload takes more than the tool's mass.
    """
    if plant.payload_kg == 0.0:
        return tool
    if plant.payload_kg < 0:
        if plant.payload_kg <= -tool.inertia.mass:
            raise InvalidInputError(
                f"payload_kg = {plant.payload_kg} takes more than the {tool.inertia.mass:g} kg of tool "
                f"'{tool.name}'; give a larger one"
            )
        return replace(tool, inertia=_scaled(tool.inertia, 1.0 + plant.payload_kg / tool.inertia.mass))
    point = Inertia(plant.payload_kg, tool.inertia.com, (1e-6, 1e-6, 1e-6, 0.0, 0.0, 0.0))
    return replace(tool, inertia=tool.inertia + point)


def _visual(root: ET.Element) -> None:
    visual = ET.SubElement(root, "visual")
    ET.SubElement(visual, "global", offwidth="1280", offheight="1280")
    ET.SubElement(visual, "quality", offsamples="0", shadowsize="0")
    ET.SubElement(visual, "map", znear="0.01")


def _fixture(world: ET.Element, fixture: Fixture) -> None:
    body = ET.SubElement(
        world, "body", name=fixture.name, pos=numbers(fixture.position), quat=numbers(fixture.quat)
    )  # fmt: skip
    for box in fixture.boxes:
        ET.SubElement(
            body, "geom", name=box.name, type="box", pos=numbers(box.centre), quat=numbers(box.quat),
            size=numbers(box.half_size), contype="1", conaffinity="2", solref=numbers(fixture.solref),
            rgba=numbers(box.rgba),
        )  # fmt: skip


def _obstacle(world: ET.Element, index: int, obstacle: Obstacle) -> None:
    name = f"obstacle{index}"
    body = ET.SubElement(world, "body", name=name, pos=numbers(obstacle.position), gravcomp="1")
    damping = 0.0 if obstacle.fixed else 2 * obstacle.damping_ratio * math.sqrt(obstacle.stiffness * obstacle.mass)
    axes = () if obstacle.fixed else zip("xyz", ("1 0 0", "0 1 0", "0 0 1"), strict=True)
    for axis, direction in axes:
        ET.SubElement(
            body, "joint", name=f"{name}_{axis}", type="slide", axis=direction,
            stiffness=numbers([obstacle.stiffness]), damping=numbers([damping]),
        )  # fmt: skip
    shape: dict[str, Any] = {"type": "sphere", "size": numbers([obstacle.radius])}
    if obstacle.half_length > 0:
        shape = {"type": "cylinder", "size": numbers((obstacle.radius, obstacle.half_length))}
    ET.SubElement(
        body, "geom", name=name, mass=numbers([obstacle.mass]), contype="1", conaffinity="2",
        solref=f"{obstacle.surface_s!r} 1", rgba="0.85 0.45 0.1 1", **shape,
    )  # fmt: skip


def _sensors(root: ET.Element, tool: Tool, config: WorldConfig) -> None:
    sensor = ET.SubElement(root, "sensor")
    ET.SubElement(sensor, "force", name="wrist_force", site=FLANGE_SITE)
    ET.SubElement(sensor, "torque", name="wrist_torque", site=FLANGE_SITE)
    ET.SubElement(sensor, "accelerometer", name="wrist_accelerometer", site="tool_com")
    for index, fixture in enumerate(config.fixtures):
        if tool.tip is not None:
            ET.SubElement(
                sensor, "contact", name=f"tip_fixture{index}", body1=fixture.name, geom2=TIP_GEOM, reduce="netforce",
                data="found force torque pos",
            )  # fmt: skip
        ET.SubElement(
            sensor, "contact", name=f"arm_fixture{index}", body1=fixture.name, subtree2="link1", reduce="netforce",
            data="found force",
        )  # fmt: skip
    for index in range(len(config.obstacles)):
        ET.SubElement(
            sensor, "contact", name=f"arm_obstacle{index}", geom1=f"obstacle{index}", subtree2="link1",
            reduce="netforce", data="found force",
        )  # fmt: skip


def _base_sensor(root: ET.Element) -> None:
    """Put a sensor under the base, its axes those of the world."""
    base = next(body for body in root.iter("body") if body.get("name") == "link0")
    ET.SubElement(base, "site", name="base")
    for name, kind in (("base_force", "force"), ("base_torque", "torque")):
        ET.SubElement(root.find("sensor"), kind, name=name, site="base")  # type: ignore[arg-type]
