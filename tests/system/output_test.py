#!/usr/bin/env python3
"""What both programs print and write: lost output is a failure, and what is read is never overwritten."""
import json
import signal
import subprocess
import unittest

from harness import COMBFORCE, COMBFORCED, PATIENCE_S, SystemTest, run, small_instrument, wait_for

LINES, COLUMNS = 2, 4


def run_with(redirection, *command):
    """Runs a program with its output redirected by a shell."""
    return run("sh", "-c", f'{redirection[0]} exec "$@" {redirection[1]}', "sh", *command)


FULL = ("", "> /dev/full")
CLOSED = ("", ">&-")
LIMITED = ("ulimit -f 1;", "")  # 512 bytes a file: less than a pixel


class OutputTest(SystemTest):
    def setUp(self):
        super().setUp()
        self.configuration = self.write("small.json", small_instrument(LINES, COLUMNS))
        done = run(COMBFORCE, "simulate", "--config", self.configuration, "--output", self.directory / "small")
        self.assertEqual(0, done.returncode, done.stderr)
        self.meta = self.directory / "small.sigmf-meta"
        self.data = self.directory / "small.sigmf-data"

    def contents(self):
        return {path.name: path.read_bytes() for path in self.directory.iterdir() if path.is_file()}


class LostOutput(OutputTest):
    def fails(self, redirection, command, *said):
        done = run_with(redirection, *command)
        self.assertEqual(1, done.returncode, (command, done.stderr))
        for part in said:
            self.assertIn(part, done.stderr, command)

    def test_stdout(self):
        replay = [COMBFORCE, "replay", self.meta]
        spectrum = self.write("flat.txt", "".join(f"{50 * i} 1e-12\n" for i in range(4000)))
        calibrate = [COMBFORCE, "calibrate", "thermal", spectrum, "--mode", "5e4:20", "--band", "4e4:6e4"]
        commands = [replay, [*replay, "--json"], [*replay, "--output", "-"], [COMBFORCE, "--help"],
                    [COMBFORCE, "replay", "--help"], [COMBFORCED, "--help"], [COMBFORCED, "--print-config"],
                    [COMBFORCED, "--config", self.configuration, "--check-config"]]
        for command in commands:
            self.fails(FULL, command, "stdout: No space left on device")
            self.fails(CLOSED, command, "stdout: Bad file descriptor")
        for command in [calibrate, [*calibrate, "--json"]]:  # whose fit of so flat a spectrum may fail by itself
            self.assertNotEqual(0, run_with(FULL, *command).returncode)

    def test_status(self):
        daemon = self.daemon(small_instrument())
        for more in [[], ["--json"]]:
            self.fails(FULL, [COMBFORCE, "status", "--connect", f"unix:{daemon.socket_path}", *more],
                       "No space left on device")

    def test_file(self):
        self.fails(("", ""), [COMBFORCE, "replay", self.meta, "--output", "/dev/full"],
                   "combforce: /dev/full: No space left on device")
        output = self.directory / "limited.ndjson"
        self.fails(LIMITED, [COMBFORCE, "replay", self.meta, "--output", output],
                   f"combforce: {output}: File too large")


class ReplayInputs(OutputTest):
    def refuses(self, code, said, *arguments):
        before = self.contents()
        done = run(COMBFORCE, *arguments)
        self.assertEqual(code, done.returncode, done.stderr)
        self.assertIn(said, done.stderr)
        self.assertEqual(before, self.contents(), arguments)

    def test_are_never_overwritten(self):
        link, hard_link = self.directory / "link", self.directory / "hard-link"
        link.symlink_to(self.data)
        hard_link.hardlink_to(self.meta)
        for output in [self.meta, self.data, self.directory / "." / "small.sigmf-data", link, hard_link]:
            self.refuses(1, f"{output}: would overwrite", "replay", self.meta, "--output", output)
        self.refuses(1, "would overwrite", "replay", self.meta, "--config", self.configuration, "--output",
                     self.configuration)
        for option in ["--output", "--table"]:
            self.refuses(1, "would overwrite", "calibrate", "thermal", self.meta, "--sensitivity", "1", option,
                         self.data)

    def test_that_are_bad_leave_the_output_alone(self):
        output = self.write("old.ndjson", "kept\n")
        meta = json.loads(self.meta.read_text(encoding="utf-8"))
        alone = self.write("alone.sigmf-meta", meta)
        self.refuses(3, "alone.sigmf-data", "replay", alone, "--output", output)
        for described in [meta["global"], *meta["captures"]]:
            described.pop("afm:comb", None)
            described.pop("afm:free_response", None)
        without_comb = self.write("no-comb.sigmf-meta", meta)
        (self.directory / "no-comb.sigmf-data").write_bytes(self.data.read_bytes())
        self.refuses(3, f"{without_comb}: comb: missing", "replay", without_comb, "--output", output)
        self.refuses(2, "--model: nope", "replay", self.meta, "--model", "nope", "--output", output)


class Watch(SystemTest):
    def test_maps_of_a_scan_that_the_daemon_does_not_finish(self):
        for sent in [signal.SIGTERM, signal.SIGKILL]:
            with self.subTest(signal=sent.name):
                daemon = self.daemon(small_instrument(1000, 100))
                maps, output = self.directory / f"maps-{sent.name}", self.directory / f"{sent.name}.ndjson"
                watch = subprocess.Popen(
                    [COMBFORCE, "watch", "--connect", f"unix:{daemon.socket_path}", "--start-scan", "--frames", "1",
                     "--maps", maps, "--output", output], stderr=subprocess.PIPE, text=True)
                wait_for(lambda: output.exists() and output.stat().st_size > 0, "the first pixel")
                daemon.end(sent)
                _, said = watch.communicate(timeout=PATIENCE_S)
                self.assertEqual(1, watch.returncode, said)
                self.assertTrue((maps / "trace_status.gsf").exists(), said)


if __name__ == "__main__":
    unittest.main()
