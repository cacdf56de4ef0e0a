#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What a cold build costs, without ccache: CPU seconds (user + system), elapsed time, largest compiler process.

  tools/build_time.py [TARGET ...]              and the slowest translation units; default helicarm-first-demo
  tools/build_time.py --doc docs/install.md     the steps of ./run, into that document's table

Builds into build/cold, which it deletes first. Elapsed time depends on what else runs; CPU seconds do too where the cores
are shared. TARGET: helicarm-first-demo (what ./run shows first), helicarm, all, ...
"""
import argparse
import os
import pathlib
import re
import resource
import shutil
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
LOG = "HELICARM_BUILD_TIME_LOG"
FOLDER = ROOT / "build" / "cold"
# Like tools/build.sh.
CONFIGURE = ("cmake", "--preset", "release", "-S", ROOT, "-B", FOLDER, f"-DCMAKE_CXX_COMPILER_LAUNCHER={__file__}",
             f"-DCMAKE_CXX_COMPILER={os.environ.get('CXX') or shutil.which('clang++-16') or 'g++'}")


def launch(command):
    """As the compiler's launcher: notes what its process took."""
    code = subprocess.run(command).returncode
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    with open(os.environ[LOG], "a") as log:
        log.write(f"{used.ru_utime + used.ru_stime:.2f} {used.ru_maxrss // 1024} {command[-1]}\n")
    return code


def cost(name, *command):
    """Row of the table: CPU seconds with those of its children, seconds, MB of the largest compiler, else of the process."""
    begin = time.monotonic()
    log = FOLDER / "times.txt"
    log.unlink(missing_ok=True)
    process = subprocess.Popen([str(word) for word in command], stdout=sys.stderr, cwd=FOLDER, env={**os.environ, LOG: str(log)})
    _, status, used = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{name}: failed")
    compilers = [int(line.split()[1]) for line in log.read_text().splitlines()] if log.exists() else []
    memory = max(compilers or [used.ru_maxrss // 1024])
    row = f"| {name} | {used.ru_utime + used.ru_stime:.0f} | {time.monotonic() - begin:.0f} | {memory} |"
    print(row, flush=True)
    return row


def build(target):
    return "cmake", "--build", FOLDER, "--target", target


def steps():
    """The steps of ./run on a machine that has the packages."""
    yield cost("configure", *CONFIGURE)
    yield cost("build what the first result needs", *build("helicarm-first-demo"))
    yield cost("first result: simulate, measure, report", FOLDER / "bin" / "helicarm-first-demo")
    yield cost("build the other commands", *build("helicarm"))


def main():
    if os.environ.get(LOG):
        return launch(sys.argv[1:])
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="*", default=["helicarm-first-demo"], metavar="TARGET")
    parser.add_argument("--doc", type=pathlib.Path)
    options = parser.parse_args()
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir(parents=True)
    if options.doc:
        table = ["| step | CPU s | elapsed s | largest process, MB |", "| --- | --- | --- | --- |", *steps()]
        text = options.doc.read_text(encoding="utf-8")
        marked = re.compile(r"(<!-- build -->\n).*?(<!-- /build -->)", re.DOTALL)
        options.doc.write_text(marked.sub(lambda found: found[1] + "\n".join(table) + "\n" + found[2], text), encoding="utf-8")
        return 0
    subprocess.run([str(word) for word in CONFIGURE], check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["cmake", "--build", FOLDER, "--target", *options.targets], check=True, stdout=sys.stderr,
                   env={**os.environ, LOG: str(FOLDER / "times.txt")})
    units = [line.split() for line in (FOLDER / "times.txt").read_text().splitlines()]
    for seconds, memory, unit in sorted(units, key=lambda one: -float(one[0]))[:12]:
        print(f"{float(seconds):7.1f} s  {memory:>5} MB  {re.sub(r'.*/(src|apps|python|CMakeFiles)/', '', unit)}")
    print(f"{sum(float(seconds) for seconds, *_ in units):7.1f} s  compiling {len(units)} units")
    return 0


if __name__ == "__main__":
    sys.exit(main())
