#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Many misbehaving peers (silent, echo only, never reading), over raw sockets, against `helicarm receive` and
`helicarm virtual-or`.

    tools/drills/drill_crowds.py [--program build/bin/helicarm] [--seconds 20] [--only NAME]

Prints how long a C-arm cannot connect, the processor time without descriptors, and the resident memory (MiB) before,
during (peak) and after each load. Exits 1 if a limit of docs/devices.md is exceeded.
"""

import argparse
import contextlib
import os
import pathlib
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
failures = []


def check(name, good):
    print(f"{'ok  ' if good else 'FAIL'} {name}", flush=True)
    if not good:
        failures.append(name)


def connect(port, receive_buffer=None, patience=10):
    peer = socket.socket()
    if receive_buffer:
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
    peer.settimeout(patience)
    peer.connect(("127.0.0.1", port))
    return peer


def close_all(peers):
    for peer in peers:
        peer.close()


# The program under test

class Program:
    def __init__(self, words, first_line, descriptors=None, stdin=subprocess.PIPE, folder="."):
        limit = ["prlimit", f"--nofile={descriptors}"] if descriptors else []
        self.log = open(pathlib.Path(folder) / "log", "w+")
        self.process = subprocess.Popen([*limit, *map(str, words)], stdin=stdin, stdout=subprocess.DEVNULL,
                                        stderr=self.log)
        self.peak = 0
        while first_line not in self.text():
            if self.process.poll() is not None:
                sys.exit("cannot start: " + self.text())
            time.sleep(0.05)
        self.over = threading.Event()
        self.watcher = threading.Thread(target=self.watch)
        self.watcher.start()

    def text(self):
        return pathlib.Path(self.log.name).read_text()

    def port_after(self, words):
        return int(self.text().split(words)[1].split()[0].rstrip(",;"))

    def memory_mib(self):
        with contextlib.suppress(OSError, IndexError):
            pages = int(pathlib.Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
            return pages * os.sysconf("SC_PAGE_SIZE") / 2**20
        return 0

    def processor_s(self):
        """Processor time, used and queued for: a busy loop is visible on a loaded machine, too."""
        times = [path.read_text().split() for path in pathlib.Path(f"/proc/{self.process.pid}/task").glob("*/schedstat")]
        return sum(int(on) + int(waits) for on, waits, _ in times) / 1e9

    def watch(self):
        while not self.over.wait(0.1):
            self.peak = max(self.peak, self.memory_mib())
            if self.peak > 4096:  # limit of the drill's memory
                self.process.kill()

    def stop(self):
        self.over.set()
        self.watcher.join()
        self.process.send_signal(signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(10)
        if self.process.poll() is None:
            self.process.kill()
        self.log.close()


@contextlib.contextmanager
def running(*arguments, **more):
    with tempfile.TemporaryDirectory() as folder:
        program = Program(*arguments, folder=folder, **more)
        try:
            yield program
        finally:
            program.stop()


def receiving(program, folder, *options, **more):
    return running([program, "receive", "--out", pathlib.Path(folder) / "inbox", "--port", "0", *options], "listens on",
                   **more)


def virtual_or(program, **more):
    ports = [word for name in ("tracker", "rtde", "dashboard", "script", "primary") for word in (f"--{name}-port", "0")]
    return running([program, "virtual-or", "--size", "512", *ports], "commands:", **more)


# DICOM

def item(kind, content):
    return struct.pack(">BBH", kind, 0, len(content)) + content


def associate_request():
    context = item(0x20, b"\1\0\0\0" + item(0x30, b"1.2.840.10008.1.1") + item(0x40, b"1.2.840.10008.1.2.1"))
    body = (struct.pack(">HH", 1, 0) + b"HELICARM".ljust(16) + b"C_ARM".ljust(16) + bytes(32) +
            item(0x10, b"1.2.840.10008.3.1.1.1") + context + item(0x50, item(0x51, struct.pack(">I", 16384))))
    return struct.pack(">BBI", 1, 0, len(body)) + body


def echo_request():
    def element(number, value):
        return struct.pack("<HHI", 0, number, len(value)) + value

    command = (element(2, b"1.2.840.10008.1.1\0") + element(0x100, struct.pack("<H", 0x30)) +
               element(0x110, struct.pack("<H", 7)) + element(0x800, struct.pack("<H", 0x101)))
    return struct.pack(">BBI", 4, 0, len(command) + 6) + struct.pack(">IBB", len(command) + 2, 1, 3) + command


def answer_type(peer):
    try:
        return peer.recv(4096)[:1]
    except OSError:
        return b""


def associated(port, patience=10):
    try:
        peer = connect(port, patience=patience)
        peer.sendall(associate_request())
        if answer_type(peer) == b"\2":
            return peer
        peer.close()
    except OSError:
        pass
    return None


def blocked_s(port, most_s):
    """Seconds until a C-arm is served; one attempt each 0.1 s."""
    begin = time.monotonic()
    while time.monotonic() - begin < most_s:
        peer = associated(port, patience=1)
        if peer:
            peer.sendall(echo_request())
            answered = answer_type(peer) == b"\4"
            peer.close()
            if answered:
                return time.monotonic() - begin
        time.sleep(0.1)
    return float("inf")


def drill_silent(program, seconds):
    with tempfile.TemporaryDirectory() as folder, receiving(program, folder) as receiver:
        port = receiver.port_after("port ")
        crowd = [connect(port) for _ in range(500)]
        waited = blocked_s(port, 15)
        check(f"500 silent connections block a C-arm for {waited:.1f} s", waited < 1)
        close_all(crowd)


def drill_echoing(program, seconds):
    with tempfile.TemporaryDirectory() as folder, receiving(program, folder) as receiver:
        port = receiver.port_after("port ")
        crowd = [peer for peer in (associated(port) for _ in range(32)) if peer]
        over = threading.Event()

        def echo_on():
            while not over.wait(0.5):
                for peer in crowd:
                    with contextlib.suppress(OSError):
                        peer.sendall(echo_request())
                        peer.recv(4096)

        echoing = threading.Thread(target=echo_on)
        echoing.start()
        time.sleep(1)
        waited = blocked_s(port, 20)
        over.set()
        echoing.join()
        check(f"{len(crowd)} associations that only echo block a C-arm for {waited:.1f} s", waited < 5)
        close_all(crowd)


def drill_descriptors(program, seconds):
    with tempfile.TemporaryDirectory() as folder, receiving(program, folder, descriptors=40) as receiver:
        port = receiver.port_after("port ")
        crowd = [connect(port) for _ in range(100)]
        time.sleep(1)
        before = receiver.processor_s()
        time.sleep(5)
        used = receiver.processor_s() - before
        check(f"without descriptors the receiver uses {used:.2f} s of processor time in 5 s", used < 2.5)
        close_all(crowd)
        check("and accepts associations again", blocked_s(port, 15) < 15)


# OpenIGTLink

def crc64(data):
    crc = 0
    for byte in data:
        crc ^= byte << 56
        for _ in range(8):
            crc = (crc << 1 ^ 0x42F0E1EBA9EA3693 if crc >> 63 else crc << 1) & (1 << 64) - 1
    return crc


def igtl(kind, body=b"", announced=None, crc=None):
    size = len(body) if announced is None else announced
    return struct.pack(">H12s20sQQQ", 1, kind.encode(), b"drill", 0, size, crc64(body) if crc is None else crc) + body


START = igtl("STT_TDATA", struct.pack(">i32s", 0, b""))


def watch_memory(name, process, crowd, seconds, most_mib):
    """Runs `crowd` and checks that the memory grows by less than `most_mib`."""
    time.sleep(1)
    before, process.peak = process.memory_mib(), 0
    crowd(time.monotonic() + seconds)
    during = process.peak
    time.sleep(1)
    after = process.memory_mib()
    alive = process.process.poll() is None
    check(f"{name}: {before:.0f} MiB before, at most {during:.0f} during, {after:.0f} after {seconds} s",
          alive and during < before + most_mib)


def tracker_crowds(port):
    def never_read(until):
        peers = [connect(port, 4096) for _ in range(32)]
        while time.monotonic() < until:
            for peer in peers:
                with contextlib.suppress(OSError):
                    peer.sendall(START)
            time.sleep(0.1)
        close_all(peers)

    def questions(until):
        peers = [connect(port, 4096) for _ in range(32)]
        for peer in peers:
            peer.setblocking(False)
        flood = igtl("GET_STATUS") * 1000
        while time.monotonic() < until:
            for peer in peers:
                with contextlib.suppress(OSError):
                    peer.send(flood)
            time.sleep(0.05)
        close_all(peers)

    def storm(until):
        while time.monotonic() < until:
            peers = []
            for _ in range(50):
                with contextlib.suppress(OSError):
                    peers.append(connect(port))
                    peers[-1].sendall(START[:70] if len(peers) % 2 else START)
            close_all(peers)
            time.sleep(0.05)

    def halves(until):
        """Volumes of 64 MiB that remain incomplete."""
        peers = [connect(port) for _ in range(32)]
        chunk = bytes(1 << 20)
        for peer in peers:
            with contextlib.suppress(OSError):
                peer.sendall(igtl("IMAGE", b"", 64 << 20, 0))
                for _ in range(63):
                    peer.sendall(chunk)
        time.sleep(max(0, until - time.monotonic()))
        close_all(peers)

    return {"never_read": never_read, "questions": questions, "storm": storm, "halves": halves}


def drill_tracker(program, seconds):
    with virtual_or(program) as virtual:
        port = virtual.port_after("(OpenIGTLink) port ")
        for name, crowd in tracker_crowds(port).items():
            watch_memory(f"tracker, {name}", virtual, crowd, seconds, 64)


# Robot

def rtde(kind, content):
    return struct.pack(">HB", len(content) + 3, ord(kind)) + content


SUBSCRIBE = (rtde("V", b"\0\2") + rtde("O", struct.pack(">d", 125) + b",".join([b"actual_q"] * 450)) + rtde("S", b""))


def robot_crowds(rtde_port, dashboard_port, script_port):
    def hold(peers, until):
        time.sleep(max(0, until - time.monotonic()))
        close_all(peers)

    def states(until):
        peers = []
        for _ in range(500):
            with contextlib.suppress(OSError):
                peers.append(connect(rtde_port, 4096))
                peers[-1].sendall(SUBSCRIBE)
        hold(peers, until)

    def questions(until):
        peers = []
        for _ in range(500):
            with contextlib.suppress(OSError):
                peers.append(connect(dashboard_port, 4096))
                peers[-1].setblocking(False)
        flood = b"PolyscopeVersion\n" * 200
        while time.monotonic() < until:
            for peer in peers:
                with contextlib.suppress(OSError):
                    peer.send(flood)
            time.sleep(0.05)
        close_all(peers)

    def scripts(until):
        peers = []
        for _ in range(500):
            with contextlib.suppress(OSError):
                peers.append(connect(script_port, 4096))
                peers[-1].sendall(b"x" * (1 << 17))
        hold(peers, until)

    def storm(until):
        while time.monotonic() < until:
            peers = []
            for port in (rtde_port, dashboard_port, script_port) * 30:
                with contextlib.suppress(OSError):
                    peers.append(connect(port))
                    peers[-1].sendall(SUBSCRIBE)
            close_all(peers)
            time.sleep(0.05)

    return {"states": states, "questions": questions, "scripts": scripts, "storm": storm}


def drill_robot(program, seconds):
    with virtual_or(program) as virtual:
        ports = [virtual.port_after(f"{name} ") for name in ("RTDE", "dashboard", "script")]
        for name, crowd in robot_crowds(*ports).items():
            watch_memory(f"robot, {name}", virtual, crowd, seconds, 64)


def drill_virtual_or_descriptors(program, seconds):
    with virtual_or(program, descriptors=40) as virtual:
        crowd = []
        for name in ("(OpenIGTLink) port", "RTDE", "dashboard", "script"):
            crowd += [connect(virtual.port_after(f"{name} ")) for _ in range(10)]
        def processor_time(seconds):
            before = virtual.processor_s()
            time.sleep(seconds)
            return virtual.processor_s() - before

        used = processor_time(5)
        close_all(crowd)
        time.sleep(1)
        usual = processor_time(5)
        check(f"without descriptors virtual-or uses {used:.2f} s of processor time in 5 s, otherwise {usual:.2f}",
              used < usual + 2.5)


def drill_input(program, seconds):
    with open("/dev/zero", "rb") as endless, virtual_or(program, stdin=endless) as virtual:
        watch_memory("standard input without an end of line", virtual,
                     lambda until: time.sleep(max(0, until - time.monotonic())), seconds, 64)


DRILLS = {"silent": drill_silent, "echoing": drill_echoing, "descriptors": drill_descriptors,
          "tracker": drill_tracker, "robot": drill_robot, "virtual_or_descriptors": drill_virtual_or_descriptors,
          "input": drill_input}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=ROOT / "build" / "bin" / "helicarm", type=pathlib.Path)
    parser.add_argument("--seconds", default=20, type=int, help="of each load on tracker and robot")
    parser.add_argument("--only", choices=DRILLS)
    arguments = parser.parse_args()
    for name, drill in DRILLS.items():
        if arguments.only in (None, name):
            drill(arguments.program, arguments.seconds)
    print(f"{len(failures)} failures")
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
