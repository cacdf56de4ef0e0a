#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Sends images to `helicarm receive` with DCMTK's echoscu and storescu (package dcmtk).

    tools/drills/drill_receiver.py [--build build] [--kills 200]

Plain and TLS, wrong titles, unknown and expired certificates, old versions of TLS, twenty senders at once, an abort,
SIGTERM, and SIGKILL at random times, after which every acknowledged image must be complete. Exits 1 on a failed check.
"""

import argparse
import contextlib
import pathlib
import random
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
failures = []


def check(name, good):
    print(f"{'ok  ' if good else 'FAIL'} {name}", flush=True)
    if not good:
        failures.append(name)


class Receiver:
    def __init__(self, program, inbox, *options):
        # A file: an unread pipe would block the receiver once full.
        self.log = tempfile.NamedTemporaryFile("r")
        with open(self.log.name, "w") as log:
            self.process = subprocess.Popen([program, "receive", "--out", inbox, "--port", "0", *options],
                                            stdout=subprocess.DEVNULL, stderr=log)
        while "port " not in self.lines():
            if self.process.poll() is not None:
                sys.exit("cannot start: " + self.lines())
            time.sleep(0.01)
        self.port = self.lines().split("port ")[1].split()[0].rstrip(",;")

    def lines(self):
        return pathlib.Path(self.log.name).read_text()

    def logs(self, words):
        """Whether the log contains these words within 10 s."""
        for _ in range(100):
            if words in self.lines():
                return True
            time.sleep(0.1)
        return False

    def stop(self):
        begin = time.monotonic()
        self.process.send_signal(signal.SIGTERM)
        code = self.process.wait(10)
        return code, time.monotonic() - begin

    def kill(self):
        self.process.kill()
        self.process.wait()


@contextlib.contextmanager
def receiving(program, inbox, *options):
    receiver = Receiver(program, inbox, *options)
    try:
        yield receiver
    finally:
        receiver.stop()


def dcmtk(tool, port, *words, called="HELICARM"):
    return subprocess.run([tool, "-aec", called, "-to", "10", *words[:-1], "127.0.0.1", port,
                           *([words[-1]] if tool == "storescu" else [])],
                          stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 0


def echo(port, *words, called="HELICARM"):
    return dcmtk("echoscu", port, *words, "", called=called)


def store(port, image, *words, called="HELICARM"):
    return dcmtk("storescu", port, *words, str(image), called=called)


def simulate_images(program, folder, count):
    images = []
    for seed in range(1, count // 2 + 1):
        case = folder / f"case{seed}"
        subprocess.run([program, "simulate", case, "--seed", str(seed), "--size", "512", "--quiet"], check=True)
        images += [case / "AP.dcm", case / "LAT.dcm"]
    return images


def certificates(folder):
    def openssl(*words):
        subprocess.run(["openssl", *words], check=True, cwd=folder, stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL)

    for authority in ("ca", "other"):
        openssl("req", "-x509", "-newkey", "rsa:2048", "-nodes", "-keyout", f"{authority}.key", "-out",
                f"{authority}.pem", "-days", "2", "-subj", f"/CN={authority}")
    for name, authority, days in (("server", "ca", "2"), ("client", "ca", "2"), ("stranger", "other", "2"),
                                  ("expired", "ca", "-1")):
        openssl("req", "-newkey", "rsa:2048", "-nodes", "-keyout", f"{name}.key", "-out", f"{name}.csr", "-subj",
                f"/CN={name}")
        openssl("x509", "-req", "-in", f"{name}.csr", "-CA", f"{authority}.pem", "-CAkey", f"{authority}.key",
                "-CAcreateserial", "-out", f"{name}.pem", "-days", days)


def drill_plain(program, folder, images):
    with receiving(program, folder / "plain", "--peer", "STORESCU", "--peer", "ECHOSCU") as receiver:
        check("echo", echo(receiver.port))
        check("store", store(receiver.port, images[0]))
        check("store again", store(receiver.port, images[0]))
        check("one file of it", len(list((folder / "plain").glob("*.dcm"))) == 1)
        check("wrong called title is rejected", not echo(receiver.port, called="OTHER"))
        check("unknown calling title is rejected", not echo(receiver.port, "-aet", "STRANGER"))
        store(receiver.port, images[1], "--abort")
        check("an abort is logged", receiver.logs("interrupted: ") and receiver.logs("aborted by the peer"))
        check("accepts associations after an abort", echo(receiver.port))
        senders = [subprocess.Popen(["storescu", "-aec", "HELICARM", "127.0.0.1", receiver.port, image],
                                    stderr=subprocess.DEVNULL) for image in images[:20]]
        check("twenty senders at once", all(sender.wait(60) == 0 for sender in senders))
        check("all their images are stored", len(list((folder / "plain").glob("*.dcm"))) == len(images[:20]))


def drill_tls(program, folder, image):
    certificates(folder)

    def tls(name, authority="ca"):
        return ["+tls", str(folder / f"{name}.key"), str(folder / f"{name}.pem"), "+cf", str(folder / f"{authority}.pem")]

    options = ["--tls-certificate", folder / "server.pem", "--tls-key", folder / "server.key", "--tls-authorities",
               folder / "ca.pem"]
    with receiving(program, folder / "tls", *options) as receiver:
        check("TLS echo", echo(receiver.port, *tls("client")))
        check("TLS store", store(receiver.port, image, *tls("client")))
        check("certificate of another authority is refused", not echo(receiver.port, *tls("stranger")))
        check("and logged", receiver.logs("TLS handshake: certificate: "))
        check("expired certificate is refused", not echo(receiver.port, *tls("expired")))
        check("and logged", receiver.logs("TLS handshake: certificate: certificate has expired"))
        for version, accepted in (("-tls1", False), ("-tls1_1", False), ("-tls1_2", True)):
            handshake = subprocess.run(["openssl", "s_client", "-connect", f"127.0.0.1:{receiver.port}", version, "-cipher",
                                     "ALL:@SECLEVEL=0", "-cert", folder / "client.pem", "-key", folder / "client.key"],
                                    stdin=subprocess.DEVNULL, capture_output=True, text=True).stdout
            check(f"s_client {version} is {'accepted' if accepted else 'refused'}", ("Cipher is (NONE)" not in handshake) == accepted)
        check("no certificate is refused", not echo(receiver.port, "+tla", "+cf", str(folder / "ca.pem")))
        check("a connection without TLS is refused", not echo(receiver.port))
        check("TLS still answers", echo(receiver.port, *tls("client")))


def drill_stop(program, folder):
    receiver = Receiver(program, folder / "stop")
    code, seconds = receiver.stop()
    check(f"SIGTERM ends it in {seconds * 1000:.0f} ms with code {code}", code == 0 and seconds < 1)
    with receiving(program, folder / "stop") as receiver:
        second = subprocess.run([program, "receive", "--out", folder / "stop2", "--port", receiver.port],
                                capture_output=True, text=True)
        check("a port that is taken: " + second.stderr.strip(), second.returncode == 2 and "port_taken" in second.stderr)


def drill_kills(program, folder, images, kills):
    inbox = folder / "kills"
    acknowledged, lost, incomplete = {}, 0, 0
    draw = random.Random(1)
    for _ in range(kills):
        for file in inbox.glob("*.dcm") if inbox.exists() else []:
            file.unlink()
        receiver = Receiver(program, inbox)
        sender = subprocess.Popen(["storescu", "-v", "-aec", "HELICARM", "127.0.0.1", receiver.port, *images],
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        time.sleep(draw.uniform(0.01, 0.25))
        receiver.kill()
        output, _ = sender.communicate(timeout=60)
        count = output.count("Received Store Response (Success)")
        acknowledged[count] = acknowledged.get(count, 0) + 1
        complete = 0
        for file in inbox.glob("*.dcm"):
            detected = subprocess.run(["dcmdump", "-q", "+P", "SOPInstanceUID", file], capture_output=True)
            complete += detected.returncode == 0 and file.stat().st_size > 512 * 512 * 2
            incomplete += file.stat().st_size <= 512 * 512 * 2
        lost += complete < count
    print(f"     acknowledged before the kill: {dict(sorted(acknowledged.items()))}")
    check(f"{kills} kills: {lost} acknowledged images lost, {incomplete} incomplete", lost == 0 and incomplete == 0)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default=ROOT / "build", type=pathlib.Path)
    parser.add_argument("--kills", default=200, type=int)
    arguments = parser.parse_args()
    program = arguments.build / "bin" / "helicarm"
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        images = simulate_images(program, folder, 20)
        drill_plain(program, folder, images)
        drill_tls(program, folder, images[0])
        drill_stop(program, folder)
        drill_kills(program, folder, images, arguments.kills)
    print(f"{len(failures)} failures")
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
