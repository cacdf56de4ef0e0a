# SPDX-License-Identifier: Apache-2.0
"""For drill_operation.py --soak: memory and descriptors of programs that work for long."""

import os
import pathlib
import resource
import time

from drill_virtual_devices import Program, check, free_port


def drill_soak(program, folder, minutes):
    """virtual-or, tracker watch and receive under load: memory and descriptors must stay constant."""
    port = free_port()
    inbox = folder / "inbox"
    receive = Program(program, "receive", "--out", inbox, "--port", port)
    receive.wait_for("listens")
    virtual_or = Program(program, "virtual-or", "--size", 512, "--receiver-port", port, "--tracker-port", 0, "--rtde-port", 0,
                   "--dashboard-port", 0, "--script-port", 0, "--primary-port", 0)
    tracker = virtual_or.wait_for("^tracker").split()[-1]
    virtual_or.wait_for("^commands: ")
    watch = Program(program, "tracker", "watch", f"127.0.0.1:{tracker}", "--ask")
    programs = {"virtual-or": virtual_or, "tracker watch": watch, "receive": receive}
    footprints, begun, acquisitions = {name: [] for name in programs}, time.monotonic(), 0
    next_sample = begun + min(30, 6 * minutes)  # after the start-up
    while time.monotonic() < begun + 60 * minutes:
        virtual_or.process.stdin.write(f"shoot {('AP', 'LAT')[acquisitions % 2]}\n")
        virtual_or.process.stdin.flush()
        virtual_or.wait_for("^shot", 30)
        acquisitions += 1
        time.sleep(0.1)
        for image in inbox.glob("*.dcm"):
            image.unlink()
        for each in programs.values():
            while not each.lines.empty():
                each.lines.get()
            each.output_lines.clear()
        if time.monotonic() >= next_sample:
            next_sample += 30
            for name, each in programs.items():
                footprints[name].append(footprint(each.process.pid))
            print(f"{time.monotonic() - begun:6.0f} s, {acquisitions} acquisitions  " + "  ".join(
                f"{name}: {values[-1][0]:.1f} MB, {values[-1][1]} files" for name, values in footprints.items()), flush=True)
    for name, values in footprints.items():  # allocators reach their steady state after some minutes
        half = max(1, len(values) // 2)
        (early_mb, early_files), (late_mb, late_files) = (tuple(map(max, zip(*part))) for part in (values[:half], values[-half:]))
        check(f"{name}: at most {early_mb:.1f} MB and {early_files} files in the first half, {late_mb:.1f} MB and "
              f"{late_files} files in the second", late_mb < 1.02 * early_mb + 1 and late_files <= early_files)
    for name, each in programs.items():
        code, seconds = each.end()
        check(f"SIGTERM ends {name} in {seconds * 1000:.0f} ms with {code}", code == 0 and seconds <= 1)


def footprint(process):
    pages = int(pathlib.Path(f"/proc/{process}/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6, len(os.listdir(f"/proc/{process}/fd"))
