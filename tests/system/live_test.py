#!/usr/bin/env python3
"""The daemon over its socket: scan, record and stop; replay of what was recorded; kill -9; a client that stops reading."""
import json
import signal
import unittest

from harness import COMBFORCE, SOURCE, SystemTest, run, small_instrument, wait_for

LINES, COLUMNS = 4, 8


def is_pixel(line):
    return line.startswith(b'{"jsonrpc":"2.0","method":"pixel"')


def pixel_lines(client, count):
    """The next `count` pixel lines as they came."""
    lines = []
    while len(lines) < count:
        line = client.line()
        if is_pixel(line):
            lines.append(line)
    return lines


class Live(SystemTest):
    def replay(self, meta, threads=1):
        output = self.directory / f"replayed-{threads}.ndjson"
        done = run(COMBFORCE, "replay", meta, "--output", output, "--threads", threads)
        self.assertEqual(0, done.returncode, done.stderr)
        return output.read_bytes().splitlines(keepends=True)

    def started(self, lines=LINES, columns=COLUMNS, **server):
        """A daemon whose free response is captured, a client that subscribes to its pixels, and one for the rest."""
        daemon = self.daemon(small_instrument(lines, columns), **server)
        control, watcher = daemon.client(), daemon.client()
        control.call("free.capture", windows=8)
        watcher.call("subscribe", topics=["pixel"])
        return daemon, control, watcher

    def test_scan_record_replay(self):
        daemon, control, watcher = self.started()
        meta = control.call("record.start", name="scan")["meta_path"]
        control.call("subscribe", topics=["frame"])
        control.call("scan.start", frames=1)
        live = pixel_lines(watcher, LINES * COLUMNS)
        counts = control.notification("frame")["counts"]
        summary = control.call("record.stop")
        self.assertEqual(0, daemon.end(), daemon.log())

        self.assertEqual(LINES * COLUMNS, counts["pixels"])
        self.assertEqual((True, 0), (summary["complete"], summary["lost_frames"]))
        self.assertFalse(daemon.socket_path.exists())
        statuses = [json.loads(line)["params"]["fit"]["status"] for line in live]
        self.assertGreater(statuses.count("converged"), LINES * COLUMNS / 2, statuses)
        self.assertEqual(live, self.replay(meta, threads=1))
        self.assertEqual(live, self.replay(meta, threads=4))

    def test_discovery_lists_what_works(self):
        client = self.daemon(small_instrument()).client()
        methods = {method["name"] for method in client.call("rpc.discover")["methods"]}
        self.assertLessEqual({"instrument.status", "scan.start", "free.capture", "record.stop", "subscribe"}, methods)
        self.assertEqual(-32601, client.request("no.such.method")["error"]["code"])  # JSON-RPC 2.0, section 5.1

    def test_recording_passes_the_schema(self):
        schema = SOURCE.parent / "shared/sigmf/sigmf-schema.json"
        if not schema.exists():
            self.skipTest("no SigMF schema beside the project")
        import jsonschema
        daemon, control, watcher = self.started()
        meta = control.call("record.start")["meta_path"]
        control.call("scan.start", frames=1)
        pixel_lines(watcher, LINES * COLUMNS)
        control.call("record.stop")
        daemon.end()
        with open(meta, encoding="utf-8") as file:
            written = json.load(file)
        jsonschema.validate(written, json.loads(schema.read_text(encoding="utf-8")))
        self.assertEqual(LINES, len(written["annotations"]))

    def test_sigterm_closes_the_recording(self):
        daemon, control, watcher = self.started()
        meta = control.call("record.start", name="cut")["meta_path"]
        control.call("scan.start", frames=0)
        live = pixel_lines(watcher, 2 * COLUMNS)
        self.assertEqual(0, daemon.end(), daemon.log())
        with open(meta, encoding="utf-8") as file:
            self.assertIn("core:sha512", json.load(file)["global"])
        self.assertEqual(live, self.replay(meta)[:2 * COLUMNS])

    def test_kill_while_recording(self):
        daemon, control, watcher = self.started()
        meta = self.directory / "killed.sigmf-meta"
        control.call("record.start", name="killed")
        control.call("scan.start", frames=0)

        def lines_on_disk():
            return meta.exists() and len(json.loads(meta.read_text(encoding="utf-8"))["annotations"]) >= LINES

        live = pixel_lines(watcher, LINES * COLUMNS)
        wait_for(lines_on_disk, "marks of a frame in the recording")
        daemon.end(signal.SIGKILL)
        replayed = [line for line in self.replay(meta) if b'"incomplete"' not in line]
        self.assertGreaterEqual(len(replayed), LINES * COLUMNS)
        self.assertEqual(live, replayed[:len(live)])

    def test_client_that_stops_reading(self):
        # More than the kernel holds for a Unix socket (0.2 MB) and the daemon for a client (64 KiB): 1600 pixels are 1 MB.
        lines, columns = 40, 40
        daemon, control, watcher = self.started(lines, columns, client_bytes=1 << 16)
        idle = daemon.client()
        idle.call("subscribe", topics=["pixel"])
        control.call("subscribe", topics=["frame"])
        control.call("scan.start", frames=1)
        self.assertEqual(lines * columns, len(pixel_lines(watcher, lines * columns)))
        self.assertEqual(lines * columns, control.notification("frame")["counts"]["pixels"])

        control.call("scan.start", lines=1, frames=1)  # what comes next is preceded by the count of what did not
        received, skipped = 0, None
        while skipped is None:
            message = idle.message()
            received += message["method"] == "pixel"
            if message["method"] == "event" and message["params"]["kind"] == "skipped":
                skipped = message["params"]
        self.assertEqual("pixel", skipped["topic"])
        self.assertEqual(lines * columns, received + skipped["count"])
        self.assertLess(skipped["first_sample"], skipped["last_sample"])
        self.assertEqual("pixel", idle.message()["method"])
        self.assertEqual(0, daemon.end(), daemon.log())


if __name__ == "__main__":
    unittest.main()
