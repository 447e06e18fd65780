"""MuJoCo's own C library, called from compiled code.

The wheel's `libmujoco` is loaded once, and its functions are declared to numba as external symbols; a compiled
function that calls them can be cached on disk and runs without the GIL. Models and data are passed as addresses,
and MjData's arrays are seen through `view1`/`view2` at addresses read from NumPy, so no struct layout is assumed.
"""

import pathlib
import sys
from typing import Any

import llvmlite.binding
import mujoco
from numba import carray, types
from numba.extending import intrinsic

from contactsafe.core.arrays import Matrix, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.errors import UnsupportedVersionError

SUPPORTED_MUJOCO = ((3, 3), (4, 1))
"""Half-open range of MuJoCo's versions whose native interface the tests have seen."""


def _version() -> tuple[int, int]:
    """Return major and minor number of the C library; `mj_version` counts otherwise before 3.5 than after."""
    major, minor = mujoco.mj_versionString().split(".")[:2]
    return int(major), int(minor)


MUJOCO = _version()


def _load_library() -> pathlib.Path:
    found = _version()
    low, high = SUPPORTED_MUJOCO
    if not low <= found < high:
        raise UnsupportedVersionError(
            f"mujoco {mujoco.mj_versionString()} is installed; contactsafe calls MuJoCo natively and was "
            "checked with 3.3 to 4.0; run: pip install 'mujoco>=3.3,<4.1'"
        )
    libraries = sorted(pathlib.Path(mujoco.__file__).parent.glob("*mujoco*.so*")) or sorted(
        pathlib.Path(mujoco.__file__).parent.glob("libmujoco*.dylib")
    )
    libraries = [path for path in libraries if path.name.startswith("libmujoco")]
    if not libraries:
        raise UnsupportedVersionError(
            "mujoco is installed without its shared library libmujoco; install the official wheel: "
            "pip install --force-reinstall mujoco"
        )
    llvmlite.binding.load_library_permanently(str(libraries[0]))
    return libraries[0]


LIBRARY = _load_library()


def _warn(message: str) -> None:
    print(f"MuJoCo: {message}", file=sys.stderr)


if mujoco.get_mju_user_warning() is None:
    mujoco.set_mju_user_warning(_warn)  # its own handler writes MUJOCO_LOG.TXT wherever the process stands

_pp = (types.uintp, types.uintp)
mj_kinematics = types.ExternalFunction("mj_kinematics", types.void(*_pp))
mj_comPos = types.ExternalFunction("mj_comPos", types.void(*_pp))
mj_comVel = types.ExternalFunction("mj_comVel", types.void(*_pp))
_composite_inertia = "mj_makeM" if MUJOCO < (3, 10) and hasattr(mujoco, "mj_makeM") else "mj_crb"
mj_crb = types.ExternalFunction(_composite_inertia, types.void(*_pp))
"""Composite inertia; where 3.3 to 3.9 have `mj_makeM`, `mj_crb` alone leaves unfilled what `mj_fullM` unpacks."""
mj_rne = types.ExternalFunction("mj_rne", types.void(*_pp, types.intc, types.CPointer(types.float64)))
mj_jacSite = types.ExternalFunction(
    "mj_jacSite", types.void(*_pp, types.CPointer(types.float64), types.CPointer(types.float64), types.intc)
)
mj_jac = types.ExternalFunction(
    "mj_jac",
    types.void(
        *_pp, types.CPointer(types.float64), types.CPointer(types.float64), types.CPointer(types.float64), types.intc
    ),
)
mj_step = types.ExternalFunction("mj_step", types.void(*_pp))

_double = types.CPointer(types.float64)
if MUJOCO >= (3, 10):
    _mj_fullM = types.ExternalFunction("mj_fullM", types.void(*_pp, _double))

    @compiled(inline="always")
    def full_inertia(model: int, data: int, packed: int, out: Any) -> None:
        """Fill the joint inertia, (nv, nv), that `mj_crb` has left in MjData; `packed` is not needed."""
        _mj_fullM(model, data, out)

else:
    _mj_fullM_packed = types.ExternalFunction("mj_fullM", types.void(types.uintp, _double, types.uintp))

    @compiled(inline="always")
    def full_inertia(model: int, data: int, packed: int, out: Any) -> None:
        """Fill the joint inertia, (nv, nv), from the packed one of `packed_inertia`."""
        _mj_fullM_packed(model, out, packed)


def packed_inertia(data: mujoco.MjData) -> int:
    """Return the address of MjData's packed inertia, which MuJoCo up to 3.9 unpacks; 0 from then on."""
    return int(data.qM.ctypes.data) if MUJOCO < (3, 10) else 0


@intrinsic
def _pointer(typing_context, address):
    """Turn an integer address into a pointer to float64."""

    def codegen(context, builder, signature, args):
        return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

    return types.CPointer(types.float64)(types.uintp), codegen


@compiled(inline="always")
def view1(address: int, n: int) -> Vector:
    """See n float64 at an address as an array, (n,)."""
    return carray(_pointer(address), (n,))


@compiled(inline="always")
def view2(address: int, rows: int, columns: int) -> Matrix:
    """See rows × columns float64 at an address as a row-major array, (rows, columns)."""
    return carray(_pointer(address), (rows, columns))
