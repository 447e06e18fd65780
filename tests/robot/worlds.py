"""Scenes as users have them: an arm among other things. Nothing in them was made for this package."""

import re
from pathlib import Path

import mujoco
import numpy as np

from contactsafe.robot.franka import HAND
from contactsafe.robot.mjcf import arm_mjcf
from contactsafe.robot.panda import PANDA

OWN_SCENE = (Path(__file__).parents[2] / "examples" / "own_scene.xml").read_text(encoding="utf-8")
_MOTORS = """
    <motor joint="pan" ctrlrange="-150 150"/>
    <motor joint="lift" ctrlrange="-150 150"/>
    <motor joint="elbow" gear="100" ctrlrange="-1.5 1.5"/>
    <motor joint="wrist1" forcerange="-28 28"/>
    <motor joint="wrist2" gear="-50" forcerange="-0.56 0.56"/>
    <general joint="wrist3" gainprm="2" ctrlrange="-14 14"/>
"""

SIX = re.sub(r"(?<=<actuator>).*(?=</actuator>)", _MOTORS, OWN_SCENE, flags=re.DOTALL)
"""The six-joint arm of the examples, driven by motors of every manner; its home reaches forward, tool down."""

ELBOW = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="a" axis="0 1 0" pos="0.02 0 0.01" ref="0.3" range="-2 2"/>
      <geom type="box" size="0.02 0.03 0.15" pos="0 0 0.15"/>
      <body name="lower" pos="0 0 0.3" euler="0.2 0.1 0">
        <joint name="b" axis="1 1 0" armature="0.01"/>
        <geom type="box" size="0.02 0.02 0.1" pos="0 0.05 0.1"/>
        <body name="plate" pos="0 0 0.2"><inertial pos="0 0 0" mass="0.3" diaginertia="0.001 0.001 0.002"/></body>
        <site name="tip" pos="0 0 0.2"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="a" ctrlrange="-5 5" gear="3" armature="0.002"/>
    <motor joint="b" ctrlrange="-5 5"/>
  </actuator>
</mujoco>
"""
"""Two joints: one away from its body's origin and with a zero of its own, one without limits; rotor behind a gear."""

BALL_SHOULDER = """
<mujoco>
  <option gravity="1 2 -9"/>
  <worldbody>
    <body name="upper">
      <joint name="x" axis="1 0 0" armature="0.1" range="-60 60"/>
      <joint name="y" axis="0 1 0" pos="0 0 0.1" armature="0.1" range="-60 60"/>
      <joint name="z" axis="0 0 1" armature="0.1" range="-60 60"/>
      <geom type="capsule" fromto="0 0 0 0.4 0 0.1" size="0.03"/>
      <body name="lower" pos="0.4 0 0.1">
        <joint name="elbow" axis="0 1 0" armature="0.1" range="-90 90"/>
        <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02"/>
        <site name="tip" pos="0.3 0 0"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="x" forcerange="-9 9"/><motor joint="y" forcerange="-9 9"/>
    <motor joint="z" forcerange="-9 9"/><motor joint="elbow" forcerange="-9 9"/>
  </actuator>
</mujoco>
"""
"""Three hinges in one body, an oblique gravity, degrees."""


def cell(base=(0.4, -0.3, 0.8), turn=(0.9, 0.1, -0.3, 0.2)) -> mujoco.MjModel:
    """A work cell: a table, a loose box, a six-joint robot, and a Panda whose gripper has fingers that slide.

    Args:
        base: where the Panda's base stands, m.
        turn: how it is turned, quaternion w x y z of any length.
    """
    panda = mujoco.MjSpec.from_string(arm_mjcf(PANDA, HAND))
    for side in (-1.0, 1.0):
        finger = panda.body("tool").add_body(name=f"finger{side:+.0f}", pos=(0.0, 0.0, 0.0584))
        finger.add_joint(
            name=f"finger{side:+.0f}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0.0, side, 0.0), range=(0.0, 0.04)
        )
        finger.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.01, 0.005, 0.02), pos=(0.0, 0.01 * side, 0.02), mass=0.1
        )
    scene = mujoco.MjSpec.from_string(re.sub(r"<keyframe>.*</keyframe>", "", SIX))
    panda.option.cone, panda.option.jacobian = scene.option.cone, scene.option.jacobian  # or MuJoCo warns
    scene.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.5, 0.5, 0.01), pos=(0.5, 0.0, 0.2))
    box = scene.worldbody.add_body(name="loose", pos=(0.5, 0.0, 0.3))
    box.add_freejoint()
    box.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.03, 0.03, 0.03))
    stand = scene.worldbody.add_body(name="stand", pos=base, quat=np.array(turn) / np.linalg.norm(turn))
    scene.attach(panda, prefix="left/", frame=stand.add_frame())
    model = scene.compile()
    q = model.qpos0.copy()
    q[[model.joint(f"left/joint{i}").qposadr[0] for i in range(1, 8)]] = PANDA.home
    q[[model.joint(f"left/finger{side}").qposadr[0] for side in ("-1", "+1")]] = 0.03
    scene.add_key(name="home", qpos=q)
    return scene.compile()


MESHES = """
<mujoco model="hulls">
  <compiler angle="radian"/>
  <default><joint range="-2.5 2.5" armature="0.05"/></default>
  <asset>
    <mesh name="wedge" vertex="0 0 0  0.1 0 0  0 0.08 0  0 0 0.3  0.05 0.02 0.28  0.1 0.01 0.02"/>
    <mesh name="stone" vertex="-0.04 0 0  0.05 0.01 0  0 0.06 0.01  0 -0.05 0.02  0.01 0 0.07  0 0.01 -0.03"/>
  </asset>
  <worldbody>
    <body name="stand" pos="-0.2 0.1 0.05" euler="0.1 -0.2 0.7">
      <geom type="cylinder" size="0.07 0.1"/>
      <geom type="ellipsoid" size="0.05 0.12 0.07" pos="0 0 0.1"/>
      <body name="cable_duct" pos="0 0.1 0"><geom type="box" size="0.02 0.03 0.04" euler="0.4 0.2 0"/></body>
      <body pos="0 0 0.2">
        <joint name="j1" axis="0 0 1"/><geom type="mesh" mesh="wedge"/>
        <body pos="0 0 0.3" euler="0.5 0 0.2">
          <joint name="j2" axis="0 1 0"/><geom type="mesh" mesh="stone" euler="0.3 0 0"/>
          <geom type="mesh" mesh="wedge" contype="0" conaffinity="0" pos="0 0.3 0"/>
          <body pos="0.2 0 0.1">
            <joint name="j3" axis="1 0.3 0"/><geom type="ellipsoid" size="0.03 0.05 0.12" pos="0 0 0.1"/>
            <body pos="0 0 0.25">
              <joint name="j4" axis="0 0 1" ref="0.4"/><geom type="box" size="0.03 0.05 0.08"/>
              <body pos="0 0.05 0.1">
                <joint name="j5" axis="0 1 0"/><geom type="sphere" size="0.04"/><geom type="cylinder" size="0.03 0.05"/>
                <body pos="0.06 0 0.1">
                  <joint name="j6" axis="0 0.2 1"/><geom type="cylinder" size="0.05 0.01"/>
                  <body pos="0 0 0.06">
                    <joint name="j7" axis="1 0 0"/><geom type="capsule" size="0.03" fromto="0 0 0 0 0.02 0.03"/>
                    <body name="gripper" pos="0 0 0.06" euler="0 0 0.5">
                      <geom type="box" size="0.02 0.05 0.03"/>
                      <body name="jaw" pos="0 0.03 0.05"><joint name="jaw" type="slide" axis="0 1 0"/>
                        <geom type="mesh" mesh="stone"/></body>
                      <site name="tip" pos="0 0 0.12" euler="0.2 0.1 0.4"/>
                    </body>
                  </body>
                </body>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="j1" ctrlrange="-90 90"/><motor joint="j2" ctrlrange="-90 90"/><motor joint="j3" ctrlrange="-90 90"/>
    <motor joint="j4" ctrlrange="-90 90"/><motor joint="j5" ctrlrange="-40 40"/><motor joint="j6" ctrlrange="-40 40"/>
    <motor joint="j7" ctrlrange="-40 40"/>
  </actuator>
</mujoco>
"""
"""Seven joints on a tilted stand, with geoms of every type, meshes that collide and one that does not."""

MESH_JOINTS = [f"j{i}" for i in range(1, 8)]

TWO_JOINTS = """<mujoco><option timestep="0.001"/><worldbody>
  <body><joint name="a" axis="0 0 1" armature="0.1" range="-2 2"/>
   <geom type="capsule" fromto="0 0 0 0 0 .3" size=".05"/>
   <body pos="0 0 .3"><joint name="b" axis="0 1 0" armature="0.1" range="-2 2"/>
    <geom type="capsule" fromto="0 0 0 .3 0 0" size=".05"/><site name="tip" pos=".35 0 0"/></body></body>
  </worldbody>
  <actuator><motor joint="a" ctrlrange="-50 50"/><motor joint="b" ctrlrange="-50 50"/></actuator></mujoco>"""
"""An arm of two hinges with their motors, as a user would bring it."""
