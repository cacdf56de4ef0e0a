#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Configures with what other packages leave half installed; each must be left out with one line.
Usage: check_setup.py SOURCE_FOLDER"""
import os
import pathlib
import subprocess
import sys
import tempfile


def configured(source, build, path):
    done = subprocess.run(["cmake", "-S", source, "-B", build, "-G", "Ninja", "-DHELICARM_TESTS=OFF"],
                          capture_output=True, text=True, env=dict(os.environ, PATH=path))
    return done.returncode, done.stdout + done.stderr


def main(source):
    with tempfile.TemporaryDirectory() as folder:
        tools = pathlib.Path(folder, "tools")
        tools.mkdir()
        for name in ("mpicxx", "mpic++", "mpiCC", "mpicc"):  # answers what it would call, and compiles nothing
            (tools / name).write_text("#!/bin/sh\ncase \"$1\" in -show*|--show*) echo -I/nowhere/include -L/nowhere -lmpi;; "
                                      "*) echo 'mpi.h: no such file' >&2; exit 1;; esac\n")
            (tools / name).chmod(0o755)
        path = f"{tools}:{os.environ['PATH']}"
        for again in (False, True):
            code, text = configured(source, pathlib.Path(folder, "build"), path)
            if code or text.count("Left out: MPI") != 1:
                sys.exit(f"{'second' if again else 'first'} configuration with a broken mpicxx: exit {code}\n{text}")


if __name__ == "__main__":
    main(sys.argv[1])
