"""Meshes that a downloaded MJCF names and that are not where it says."""

import mujoco
import pytest
from tests.robot.test_models_as_they_come import FLANGE, SERVO
from tests.robot.test_urdf_meshes import _TETRAHEDRON

from contactsafe import robots
from contactsafe.core.errors import InvalidInputError, ModelWarning
from contactsafe.sim.model_arms import load_model

SEEN = '<geom type="mesh" mesh="part" mass="0"/>'
ASSET = '<asset><mesh name="part" file="part.obj"/></asset><worldbody>'


def write(folder, geom):
    text = SERVO.replace("<worldbody>", ASSET).replace('<body name="fore"', f'{geom}<body name="fore"')
    (folder / "arm.xml").write_text(text, encoding="utf-8")
    return folder / "arm.xml"


@pytest.mark.filterwarnings("ignore:arm:UserWarning")
def test_mesh_in_another_folder_is_found(tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "part.obj").write_text(_TETRAHEDRON, encoding="utf-8")
    spec = mujoco.MjSpec.from_file(str(write(tmp_path, SEEN)))
    robots.make_torque_driven(spec, FLANGE)
    assert spec.compile().nmesh == 1


def test_mesh_that_is_only_seen_is_left_out_with_a_note(tmp_path):
    path = write(tmp_path, SEEN)
    with pytest.warns(ModelWarning, match=r"1 meshes are left out, for their files are not there: part; "):
        robots.from_mjcf(path, FLANGE, actuators="torque")


def test_mesh_that_a_body_has_its_mass_from_is_asked_for(tmp_path):
    path = write(tmp_path, '<geom type="mesh" mesh="part"/>')
    with pytest.raises(InvalidInputError, match=r"^body 'upper' has its mass from a mesh that is not there; get the"):
        robots.from_mjcf(path, FLANGE, actuators="torque")


def test_mesh_of_the_mass_is_asked_for_as_well_where_the_tool_is_searched_for(tmp_path):
    """It was taken off in silence, and the arm loaded without that mass."""
    path = write(tmp_path, '<geom type="mesh" mesh="part"/>')
    with pytest.raises(InvalidInputError, match=r"^body 'upper' has its mass from a mesh that is not there; get the"):
        load_model(str(path))


def test_mesh_that_is_not_there_stopped_an_arm_whose_tool_is_named(tmp_path):
    of = load_model(f"{write(tmp_path, SEEN)}:{FLANGE.body}")
    assert "1 meshes are left out" in of.notes


@pytest.mark.filterwarnings("ignore:arm:UserWarning")
def test_one_of_several_meshes_of_a_name_is_taken_with_a_note(tmp_path):
    for folder in ("left", "right"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "part.obj").write_text(_TETRAHEDRON, encoding="utf-8")
    with pytest.warns(ModelWarning, match=r"of 2 files called part\.obj the model takes .*left.*part\.obj"):
        robots.from_mjcf(write(tmp_path, SEEN), FLANGE, actuators="torque")
