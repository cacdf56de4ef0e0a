# SPDX-License-Identifier: Apache-2.0
"""Builds the Python module with CMake: pip install --no-build-isolation --no-deps .

HELICARM_BUILD_FOLDER: CMake's build folder, kept for the next time (default build/python).
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import sysconfig

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = pathlib.Path(__file__).resolve().parent
VERSION = re.search(r"project\(helicarm VERSION (\S+)", (ROOT / "CMakeLists.txt").read_text()).group(1)


def has_avx2():
    try:
        flags = pathlib.Path("/proc/cpuinfo").read_text().split()
    except OSError:
        return False
    return "avx2" in flags and "fma" in flags


class CMakeBuild(build_ext):
    def build_extension(self, extension):
        folder = pathlib.Path(os.environ.get("HELICARM_BUILD_FOLDER", ROOT / "build" / "python"))
        options = ["-DHELICARM_PYTHON=ON", f"-DPython3_EXECUTABLE={os.path.realpath(sys.executable)}"]
        if not (folder / "CMakeCache.txt").exists():
            options += ["-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", "-DHELICARM_TESTS=OFF", "-DHELICARM_CLI=OFF",
                        f"-DHELICARM_PORTABLE={'OFF' if has_avx2() else 'ON'}"]
        subprocess.run(["cmake", "-S", ROOT, "-B", folder, *options], check=True)
        subprocess.run(["cmake", "--build", folder, "--target", "helicarm_python"], check=True)
        built = folder / "python" / "helicarm" / f"_helicarm.{sysconfig.get_config_var('SOABI')}.so"
        target = pathlib.Path(self.get_ext_fullpath(extension.name))
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(built, target)


setup(version=VERSION, ext_modules=[Extension("helicarm._helicarm", sources=[])], cmdclass={"build_ext": CMakeBuild})
