"""MuJoCo's own C library, called from compiled code.

The wheel's `libmujoco` is loaded once, and its functions are declared to numba as external symbols; a compiled
function that calls them can be cached on disk and runs without the GIL. Models and data are passed as addresses,
and MjData's arrays are seen through `view1`/`view2` at addresses read from NumPy, so no struct layout is assumed.
"""

import pathlib
import sys

import llvmlite.binding
import mujoco
from numba import carray, types
from numba.extending import intrinsic

from contactsafe.core.arrays import Matrix, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.errors import UnsupportedVersionError

SUPPORTED_MUJOCO = (4000000, 4001000)
"""Half-open range of `mujoco.mj_version()` whose native interface the tests have seen."""


def _load_library() -> pathlib.Path:
    found = mujoco.mj_version()
    low, high = SUPPORTED_MUJOCO
    if not low <= found < high:
        raise UnsupportedVersionError(
            f"mujoco {mujoco.__version__} is installed; contactsafe calls MuJoCo natively and was "
            "checked with 4.0 only; run: pip install 'mujoco>=4.0,<4.1'"
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
mj_crb = types.ExternalFunction("mj_crb", types.void(*_pp))
mj_fullM = types.ExternalFunction("mj_fullM", types.void(*_pp, types.CPointer(types.float64)))
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
