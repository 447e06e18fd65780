"""Meshes that a downloaded model names and that are not where it says: found elsewhere, or left out with a note."""

import glob
import pathlib
from typing import Any

import mujoco

from contactsafe.robot.findings import Findings
from contactsafe.robot.names import listed
from contactsafe.robot.spec_parts import name_all, remove


def find_meshes(spec: mujoco.MjSpec, findings: Findings) -> None:
    """Edit a scene so that it compiles without meshes that are not on this disk.

    A mesh that is not where the scene says is taken from below the scene's folder; geoms of one that is not there
    either are removed. What is painted with a picture that is not there is grey.

    Args:
        spec: of the scene.
        findings: told of meshes that are left out, and of bodies that would lose their mass with them.
    """
    _paint_grey(spec)
    missing = _not_found(spec, findings)
    for geom in [geom for geom in spec.geoms if geom.meshname in missing]:
        body = geom.parent
        if body.name != "world" and not body.explicitinertial and geom.mass != 0.0 and geom.density != 0.0:
            findings.problem(f"body '{body.name}' has its mass from a mesh that is not there; get the model's meshes")
        remove(spec, geom)
    for mesh in missing.values():
        remove(spec, mesh)
    if missing:
        findings.note(
            f"{len(missing)} meshes are left out, for their files are not there: {listed(missing)}; contacts on links "
            "without geometry are attributed to others"
        )


def make_compilable(spec: mujoco.MjSpec) -> None:
    """Edit a scene so that it compiles: meshes that lie elsewhere are pointed to, what is left out is warned of.

    Args:
        spec: of the scene; parts without a name get one.

    Raises:
        InvalidInputError: a body would lose its mass.
    """
    name_all(spec)
    findings = Findings()
    find_meshes(spec, findings)
    findings.raise_problems()
    findings.warn(spec.modelname)


def _not_found(spec: mujoco.MjSpec, findings: Findings) -> dict[str, Any]:
    """Return the meshes whose files are nowhere, by name; those that are elsewhere are pointed to, and told."""
    missing = {}
    for mesh in spec.meshes:
        if not mesh.file or _is_there(spec, spec.meshdir, mesh.file):
            continue
        name = pathlib.PurePath(mesh.file).name
        found = sorted(pathlib.Path(spec.modelfiledir).rglob(glob.escape(name))) if spec.modelfiledir else []
        if found:
            mesh.file = str(found[0].resolve())
            if len(found) > 1:
                findings.note(
                    f"of {len(found)} files called {name} the model takes {mesh.file}; put the right one there"
                )
        else:
            missing[mesh.name or pathlib.PurePath(name).stem] = mesh
    return missing


def _paint_grey(spec: mujoco.MjSpec) -> None:
    """Take pictures that are not there off textures."""
    for texture in spec.textures:
        if texture.file and not _is_there(spec, spec.texturedir, texture.file):
            texture.file, texture.builtin = "", mujoco.mjtBuiltin.mjBUILTIN_FLAT
            texture.width, texture.height = 1, 1 if texture.type == mujoco.mjtTexture.mjTEXTURE_2D else 6


def _is_there(spec: mujoco.MjSpec, inside: str, file: str) -> bool:
    """Tell whether a file is among a scene's assets, or in its folder."""
    given = {pathlib.PurePath(name).name for name in spec.assets}
    folder = pathlib.Path(spec.modelfiledir or ".")
    return pathlib.PurePath(file).name in given or any((folder / place / file).is_file() for place in (inside, ""))
