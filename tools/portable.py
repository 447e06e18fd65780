"""Run a command as on a processor with little more than the instructions its architecture began with.

    python tools/portable.py python -m pytest

Compiled code, array libraries and the C library's mathematics choose instructions by the processor, and what they give
differs in the last bits. Here each is taken down to its lowest, and is seen to be there before the command starts. Out
of reach: ONNX Runtime, which has no such switch, and what is built for one instruction set (MuJoCo, Pinocchio).
"""

import hashlib
import os
import pathlib
import platform
import re
import struct
import subprocess
import sys

X86 = platform.machine() in ("x86_64", "AMD64")
GLIBC = platform.libc_ver()[0] == "glibc"
CACHE = pathlib.Path(__file__).resolve().parents[1] / "build" / "portable"


def tell():
    """Print what each library in this process has chosen, a line each; oneDNN and MKL speak for themselves."""
    import math

    import cv2
    import numba.core.registry
    import scipy.linalg  # noqa: F401  has an OpenBLAS of its own, which compiled code calls
    import threadpoolctl
    import torch
    from numpy._core import _multiarray_umath as numpy

    _, name, features = numba.core.registry.cpu_target.target_context.codegen().magic_tuple()
    print("numba:", name, features)
    print("numpy:", *[group for group in numpy.__cpu_dispatch__ if numpy.__cpu_features__[group]])
    print("openblas:", *{lib["architecture"] for lib in threadpoolctl.threadpool_info() if lib["user_api"] == "blas"})
    print("torch:", torch.backends.cpu.get_cpu_capability())
    print("opencv:", *re.findall(r"\*(\S+)(?<!\?)(?!\S)", cv2.getCPUFeaturesLine()))  # "*AVX2?" is one that is off
    sines = struct.pack("20000d", *(math.sin(0.001 * k) for k in range(20000)))
    print("libm:", hashlib.sha256(sines).hexdigest()[:8])
    image = torch.ones(1, 1, 300, 300)
    torch.nn.functional.conv2d(image, torch.ones(4, 1, 3, 3)) @ torch.ones(298, 298)


def ask(settings):
    """Give what the libraries choose under settings of the environment, by name."""
    told = subprocess.run(
        [sys.executable, __file__], env={**os.environ, **settings, "ONEDNN_VERBOSE": "1", "MKL_VERBOSE": "1"},
        stdout=subprocess.PIPE, text=True, check=True,
    ).stdout  # fmt: skip
    chosen = dict(re.findall(r"^(\w+): *(.*?) *$", told, re.MULTILINE))
    chosen["onednn"] = " ".join(set(re.findall(r"^onednn_verbose.*,cpu,isa:(.*)$", told, re.MULTILINE)))
    chosen["mkl"] = " ".join(set(re.findall(r"^MKL_VERBOSE .* CNR:(\S+)", told, re.MULTILINE)))
    return chosen


def lowest(native):
    """Give the settings that take every library to its lowest, and what each will then say it has chosen."""
    settings = {
        "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(CACHE),
        "ATEN_CPU_CAPABILITY": "default", "OPENBLAS_CORETYPE": "Nehalem" if X86 else "ARMV8",
    }  # fmt: skip
    expected = {"numba": "generic", "numpy": "", "torch": "DEFAULT", "opencv": ""}
    if native["numpy"]:  # a group of instructions that the processor lacks would be a warning
        settings["NPY_DISABLE_CPU_FEATURES"] = native["numpy"]
    if native["openblas"]:
        expected["openblas"] = settings["OPENBLAS_CORETYPE"]
    if native["opencv"]:
        settings["OPENCV_CPU_DISABLE"] = native["opencv"].replace(" ", ",")
    if X86:
        settings |= {"ONEDNN_MAX_CPU_ISA": "SSE41", "MKL_CBWR": "COMPATIBLE"}
        expected |= {"onednn": "Intel SSE4.1", "mkl": "COMPATIBLE"}
    if X86 and GLIBC:
        settings["GLIBC_TUNABLES"] = "glibc.cpu.hwcaps=-AVX2,-FMA"
    return settings, expected


def main(command):
    """Lower everything, see that it is low, and become the command."""
    native = ask({})
    settings, expected = lowest(native)
    chosen = ask(settings)
    for library, choice in chosen.items():
        print(f"{library:9} {native[library] or '-':.60} -> {choice or '-'}")
    failed = [library for library, choice in expected.items() if chosen[library].lower() != choice.lower()]
    if "GLIBC_TUNABLES" in settings and has_fma() and chosen["libm"] == native["libm"]:
        failed.append("libm")
    if failed:
        sys.exit(f"portable: {', '.join(failed)} did not go down; this would test the machine's own instructions")
    sys.stdout.flush()
    os.execvpe(command[0], command, {**os.environ, **settings})


def has_fma():
    """Tell whether the processor has the instructions with which glibc's sines come out otherwise."""
    return " fma " in pathlib.Path("/proc/cpuinfo").read_text(encoding="ascii")


if __name__ == "__main__":
    main(sys.argv[1:]) if sys.argv[1:] else tell()
