#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Many small cases by `helicarm run` on one rank of mpirun and on two: CPU and wall time, the same files, efficiency.

tools/evaluation/cases_over_ranks.py [--program build/bin/helicarm] [--cases 1000] [--ranks 1,2] [--doc docs/howto.md]

Efficiency by CPU is the CPU time of one rank for all cases, divided by the number of ranks and by the CPU time of the rank that needed
most: it holds the work of sharing and an uneven share, and does not depend on what else the machine does. That by the clock is
meaningful on a quiet machine with a core for each rank. Beside each number of ranks stand as many processes that share nothing, each
with its part of the cases: what they lose is the machine's (memory, caches, threads of one core), not the sharing's.
"""
import argparse
import json
import os
import pathlib
import resource
import shutil
import subprocess
import sys
import tempfile
import time

MARK = ("<!-- cases over ranks -->\n", "<!-- end -->")


def rank(words):
    """Runs the program as this rank and writes its times beside the others'."""
    folder, *command = words
    began = time.monotonic()
    done = subprocess.run(command, stderr=subprocess.DEVNULL).returncode
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    (pathlib.Path(folder) / f"{os.getpid()}.json").write_text(json.dumps(
        {"cpu_s": used.ru_utime + used.ru_stime, "wall_s": time.monotonic() - began, "code": done}))


def words_of_run(times, program, cases, out):
    return [sys.executable, __file__, "--rank", times, program, "--threads", "1", "run", *cases, "--out", out, "--no-report", "--quiet",
            "--no-cache"]


def read_times(times, count):
    read = [json.loads(path.read_text()) for path in times.iterdir()]
    assert len(read) == count and not any(one["code"] for one in read), read
    return read


def apart(program, cases, folder, count):
    """Times of as many processes, each with its part of the cases."""
    times = folder / f"apart{count}"
    times.mkdir()
    started = [subprocess.Popen([*map(str, words_of_run(times, program, cases[i::count], folder / f"apart{count}-{i}"))])
               for i in range(count)]
    for process in started:
        process.wait()
    return read_times(times, count)


def by_ranks(program, cases, folder, ranks):
    """(times of each rank, bytes of summary.csv)"""
    out, times = folder / f"out{ranks}", folder / f"times{ranks}"
    times.mkdir()
    environment = {**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_plm_rsh_agent": "false",
                   "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_MCA_hwloc_base_binding_policy": "none"}
    subprocess.run(["mpirun", "-n", str(ranks), *words_of_run(times, program, cases, out)], env=environment, check=True)
    return read_times(times, ranks), (out / "summary.csv").read_bytes()


def table(program, count, ranks):
    rows, first, summaries = [], None, set()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        subprocess.run([program, "simulate", folder / "case", "--kind", "flat", "--size", "512", "--seed", "1", "--quiet"], check=True)
        cases = [folder / f"c{i:04d}" for i in range(count)]
        for case in cases:
            shutil.copytree(folder / "case", case, copy_function=os.link)
        for n in ranks:
            times, summary = by_ranks(program, cases, folder, n)
            summaries.add(summary)
            for name, own in [(f"{n}", times)] + ([(f"{n} apart", apart(program, cases, folder, n))] if n > 1 else []):
                most, whole = max(one["cpu_s"] for one in own), sum(one["cpu_s"] for one in own)
                wall = max(one["wall_s"] for one in own)
                first = first or (n * whole, n * wall)
                rows.append((name, count, whole, most, first[0] / (n * most), wall, first[1] / (n * wall)))
            shutil.rmtree(folder / f"out{n}")
    assert len(summaries) == 1, "the summaries differ"
    lines = ["| ranks | cases | CPU, s | CPU of the busiest rank, s | efficiency by CPU | wall time, s | by wall time |", "| --- " * 7 + "|"]
    lines += [f"| {n} | {cases} | {whole:.1f} | {most:.1f} | {cpu:.3f} | {wall:.1f} | {clock:.3f} |"
              for n, cases, whole, most, cpu, wall, clock in rows]
    return "\n".join(lines) + "\n"


def main():
    if sys.argv[1:2] == ["--rank"]:
        return rank(sys.argv[2:])
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="build/bin/helicarm", type=pathlib.Path)
    parser.add_argument("--cases", default=1000, type=int)
    parser.add_argument("--ranks", default="1,2")
    parser.add_argument("--doc", type=pathlib.Path)
    given = parser.parse_args()
    text = table(given.program.resolve(), given.cases, [int(n) for n in given.ranks.split(",")])
    print(text)
    if given.doc:
        doc = given.doc.read_text()
        begin, end = doc.index(MARK[0]) + len(MARK[0]), doc.index(MARK[1], doc.index(MARK[0]))
        given.doc.write_text(doc[:begin] + "\n" + text + "\n" + doc[end:])


if __name__ == "__main__":
    main()
