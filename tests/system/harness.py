"""What the system tests share: the two programs, a small instrument to run them on, and a client of the daemon.

The programs come from the environment: COMBFORCED and COMBFORCE.
"""
import json
import os
import signal
import socket
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

COMBFORCED = os.environ["COMBFORCED"]
COMBFORCE = os.environ["COMBFORCE"]
PATIENCE_S = 120.0  # only a bound on a hang: under the thread sanitizer everything is 20 times slower

SOURCE = Path(__file__).resolve().parents[2]


def run(*command, timeout=PATIENCE_S, **options):
    """Runs a program to its end; gives returncode, stdout and stderr as text."""
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=timeout,
                          check=False, **options)


def wait_for(condition, what):
    """Polls until condition() is true; fails with `what` after PATIENCE_S."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.02)
    raise AssertionError(f"waited {PATIENCE_S:.0f} s for {what}")


class Client:
    """A connection to the daemon: one JSON-RPC message a line."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(PATIENCE_S)
        self.socket.connect(str(path))
        self.buffer = b""
        self.requests = 0
        self.notifications = []

    def close(self):
        self.socket.close()

    def line(self):
        """The next line of the daemon as it came, in bytes; fails when it has closed the connection."""
        while b"\n" not in self.buffer:
            received = self.socket.recv(1 << 16)
            if not received:
                raise ConnectionError("the daemon closed the connection")
            self.buffer += received
        line, self.buffer = self.buffer.split(b"\n", 1)
        return line + b"\n"

    def message(self):
        return json.loads(self.line())

    def notification(self, method):
        """The next notification of that method, of those kept or to come; those before it are dropped."""
        while True:
            message = self.notifications.pop(0) if self.notifications else self.message()
            if message.get("method") == method:
                return message["params"]

    def send(self, text):
        self.socket.sendall(text.encode() + b"\n")

    def request(self, method, **params):
        """Sends a request and gives its reply, whole; notifications that come before it are kept."""
        self.requests += 1
        self.send(json.dumps({"jsonrpc": "2.0", "id": self.requests, "method": method, "params": params}))
        while True:
            message = self.message()
            if message.get("id") == self.requests:
                return message
            self.notifications.append(message)

    def call(self, method, **params):
        """As request(), but gives the result and fails on an error."""
        reply = self.request(method, **params)
        if "result" not in reply:
            raise AssertionError(f"{method}: {reply}")
        return reply["result"]


def pixel_lines(client, count):
    """The next `count` pixel lines as they came."""
    lines = []
    while len(lines) < count:
        line = client.line()
        if line.startswith(b'{"jsonrpc":"2.0","method":"pixel"'):
            lines.append(line)
    return lines


class Daemon:
    """combforced on a configuration, from start to SIGTERM."""

    def __init__(self, directory, configuration, record_directory=None, **server):
        self.clients = []
        self.directory = Path(directory)
        self.socket_path = self.directory / "combforce.sock"
        self.configuration_path = self.directory / "daemon.json"
        configuration = dict(configuration, server={"unix_socket": str(self.socket_path), "port": 0, **server},
                             record={"directory": str(record_directory or self.directory)})
        self.configuration_path.write_text(json.dumps(configuration), encoding="utf-8")
        self.log_path = self.directory / "daemon.log"
        with open(self.log_path, "wb") as log:
            self.process = subprocess.Popen([COMBFORCED, "--config", str(self.configuration_path)], stdout=log,
                                            stderr=log)
        wait_for(lambda: self.socket_path.exists() or self.process.poll() is not None, "the daemon's socket")
        if self.process.poll() is not None:
            raise AssertionError(f"combforced ended at once:\n{self.log()}")

    def log(self):
        return self.log_path.read_text(encoding="utf-8", errors="replace")

    def client(self):
        self.clients.append(Client(self.socket_path))
        return self.clients[-1]

    def command(self, *arguments):
        """Runs `combforce ARGUMENTS --connect` on this daemon."""
        return run(COMBFORCE, *arguments, "--connect", f"unix:{self.socket_path}")

    def end(self, sent=signal.SIGTERM):
        """Sends a signal and gives the exit status."""
        self.process.send_signal(sent)
        return self.process.wait(PATIENCE_S)


class SystemTest(unittest.TestCase):
    """A test with a directory of its own, whose daemons do not outlive it."""

    def setUp(self):
        self.directory = Path(self.enterContext(tempfile.TemporaryDirectory(prefix="combforce-")))

    def daemon(self, configuration, **options):
        daemon = Daemon(self.directory, configuration, **options)
        self.addCleanup(self.reap, daemon)
        return daemon

    @staticmethod
    def reap(daemon):
        for client in daemon.clients:
            client.close()
        if daemon.process.poll() is None:
            daemon.process.kill()
            daemon.process.wait()

    def write(self, name, value):
        """A file of this test's directory: text, or an object as JSON."""
        path = self.directory / name
        path.write_text(value if isinstance(value, str) else json.dumps(value), encoding="utf-8")
        return path


SAMPLE_RATE_HZ = 5e6
WINDOW_SAMPLES = 5000
PIXEL_SAMPLES = 10000


def small_instrument(lines=4, columns=8):
    """A simulated scan of a flat surface on two low modes, 2 ms a pixel: it runs in about a second."""
    modes = [{"frequency_hz": 100e3, "quality_factor": 100, "stiffness_n_per_m": 4},
             {"frequency_hz": 600e3, "quality_factor": 300, "stiffness_n_per_m": 80}]
    comb = {"window_samples": WINDOW_SAMPLES, "tones": [{"bin": 100}, {"bin": 600}]}
    return {
        "digitizer": {"kind": "simulated", "simulation": {
            "sample_rate_hz": SAMPLE_RATE_HZ,
            "drive": {"scheme": "equal_energy", "total_amplitude_nm": 50},
            "model": "hertz",
            "scene": {"kind": "flat", "materials": [{"contact_strength_gpa_sqrt_nm": 1.0}]},
            "temperature_k": 300, "detector_nm_per_sqrt_hz": 1e-4, "seed": 7, "paced": False}},
        "cantilever": {"modes": modes},
        "comb": comb,
        "scan": {"lines": lines, "columns": columns, "pixel_samples": PIXEL_SAMPLES, "settle_samples": 5000},
        "noise": {"temperature_k": 300, "detector_nm_per_sqrt_hz": 1e-4},
        "fit": {"model": "hertz"},
        "log_level": "debug",
    }
