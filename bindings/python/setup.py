# SPDX-License-Identifier: Apache-2.0
"""Builds the compiled part and the program with CMake, and puts the libraries that they need beside them."""
import os
import pathlib
import re
import shutil
import subprocess
import sys

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
# Of the C library and the compiler's: every machine has its own.
SYSTEM = re.compile(r"^(ld-linux.*|lib(c|m|dl|rt|pthread|resolv|stdc\+\+|gcc_s))\.so")


def libraries_of(file):
    for line in subprocess.run(["ldd", str(file)], check=True, capture_output=True, text=True).stdout.splitlines():
        found = re.match(r"\s*(\S+) => (/\S+)", line)
        if found and not SYSTEM.match(found.group(1)):
            yield found.groups()


def bundle(package, files):
    """Copies what the files need into package/lib, where they then look first."""
    if not shutil.which("patchelf"):
        raise SystemExit("patchelf is needed to put the libraries into the wheel: scripts/install_packages.sh patchelf")
    folder = package / "lib"
    folder.mkdir(exist_ok=True)
    for name, path in {library for file in files for library in libraries_of(file)}:
        shutil.copyfile(path, folder / name)
        subprocess.run(["patchelf", "--set-rpath", "$ORIGIN", str(folder / name)], check=True)
    for file in files:
        to = os.path.relpath(folder, file.parent)
        subprocess.run(["patchelf", "--set-rpath", f"$ORIGIN/{to}", str(file)], check=True)


class BuildWithCMake(build_ext):
    def build_extension(self, extension):
        build = pathlib.Path(os.environ.get("REVISIT_PYTHON_BUILD", self.build_temp)).resolve()
        subprocess.run(["cmake", "-S", str(ROOT), "-B", str(build), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
                        "-DREVISIT_BUILD_TESTS=OFF", "-DREVISIT_BUILD_BENCHMARKS=OFF", "-DREVISIT_BUILD_EXAMPLES=OFF",
                        f"-DREVISIT_PYTHON_EXECUTABLE={sys.executable}"], check=True, stdout=subprocess.DEVNULL)
        subprocess.run(["cmake", "--build", str(build), "--parallel", str(os.cpu_count()), "--target", "revisit_python",
                        "revisit"], check=True)
        core = pathlib.Path(self.get_ext_fullpath(extension.name)).resolve()
        package = core.parent
        program = package / "bin" / "revisit"
        program.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(next((build / "bindings/python/revisit").glob("_core*.so")), core)
        shutil.copyfile(build / "revisit", program)
        program.chmod(0o755)
        bundle(package, [core, program])


version = re.search(r"project\(revisit VERSION (\S+)", (ROOT / "CMakeLists.txt").read_text()).group(1)
setup(version=version, packages=["revisit"], package_data={"revisit": ["py.typed", "*.pyi"]},
      ext_modules=[Extension("revisit._core", [])], cmdclass={"build_ext": BuildWithCMake})
