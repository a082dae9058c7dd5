#!/usr/bin/env python3
"""A disk that fills up while it is recorded to. Needs root: the disk is a tmpfs of a mount namespace of its own."""
import os
import subprocess
import sys
import unittest

from harness import COMBFORCE, SystemTest, pixel_lines, run, small_instrument, wait_for

LINES, COLUMNS = 4, 8
NAMESPACE = "COMBFORCE_TEST_NAMESPACE"


class DiskFull(SystemTest):
    def setUp(self):
        super().setUp()
        if NAMESPACE not in os.environ:
            self.skipTest("this user may not mount a disk")

    def small_disk(self, size_bytes):
        disk = self.directory / "disk"
        disk.mkdir()
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size_bytes}", "tmpfs", str(disk)], check=True)
        self.addCleanup(subprocess.run, ["umount", str(disk)], check=True)
        return disk

    def test_recording_stops_with_an_event_and_acquisition_goes_on(self):
        # Two channels of two bytes, 80000 samples a line: whatever the line at which the recording starts, one
        # whole line at least fits.
        disk = self.small_disk(1 << 20)
        daemon = self.daemon(small_instrument(LINES, COLUMNS), record_directory=disk)
        control, watcher = daemon.client(), daemon.client()
        control.call("free.capture", windows=8)
        control.call("subscribe", topics=["event"])
        watcher.call("subscribe", topics=["pixel"])
        control.call("scan.start", frames=1000)
        live = pixel_lines(watcher, 1)
        meta = control.call("record.start", name="full")["meta_path"]
        event = control.notification("event")
        while event["kind"] != "record_failed":
            event = control.notification("event")
        self.assertIn(str(disk), event["text"])
        self.assertIn("No space left on device", event["text"])
        wait_for(lambda: "record_failed" in daemon.log(), "the log")
        logged = [line for line in daemon.log().splitlines() if "record_failed" in line]
        self.assertIn(" error ", logged[0])
        live += pixel_lines(watcher, 10 * LINES * COLUMNS)  # the scan goes on, far beyond what the disk held
        status = control.call("instrument.status")
        self.assertEqual(("running", False), (status["state"], status["recording"]))
        summary = control.call("record.stop")
        self.assertEqual((False, event["text"]), (summary["complete"], summary["failure"]))

        output = self.directory / "replayed.ndjson"
        done = run(COMBFORCE, "replay", meta, "--output", output)
        self.assertEqual(0, done.returncode, done.stderr)
        replayed = [line for line in output.read_bytes().splitlines(keepends=True) if b'"flags":[]' in line]
        self.assertLess(COLUMNS / 2, len(replayed))
        self.assertEqual([], [line for line in replayed if line not in live])


def in_own_namespace():
    """Runs this program again where it may mount; comes back only where that cannot be."""
    if NAMESPACE in os.environ or os.geteuid() != 0:
        return
    if subprocess.run(["unshare", "--mount", "true"], check=False, stderr=subprocess.DEVNULL).returncode == 0:
        os.environ[NAMESPACE] = "own"
        os.execvp("unshare", ["unshare", "--mount", sys.executable, *sys.argv])


if __name__ == "__main__":
    in_own_namespace()
    unittest.main()
