#!/usr/bin/env python3
"""The daemon over its socket: scan, record and stop; replay of what was recorded; kill -9; a client that stops reading."""
import json
import signal
import socket
import unittest

from harness import COMBFORCE, SOURCE, SystemTest, pixel_lines, run, small_instrument, wait_for

LINES, COLUMNS = 4, 8


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
        meta = control.call("record.start", name="scan.sigmf-meta")["meta_path"]  # or "scan": one recording
        control.call("subscribe", topics=["frame"])
        control.call("scan.start", frames=1)
        live = pixel_lines(watcher, LINES * COLUMNS)
        counts = control.notification("frame")["counts"]
        summary = control.call("record.stop")
        self.assertEqual(0, daemon.end(), daemon.log())

        self.assertEqual(LINES * COLUMNS, counts["pixels"])
        self.assertEqual((True, 0), (summary["complete"], summary["lost_frames"]))
        self.assertEqual(["scan.sigmf-data", "scan.sigmf-meta", "scan.truth.ndjson"],
                         sorted(path.name for path in self.directory.rglob("scan.*")))
        self.assertFalse(daemon.socket_path.exists())
        statuses = [json.loads(line)["params"]["fit"]["status"] for line in live]
        self.assertGreater(statuses.count("converged"), LINES * COLUMNS / 2, statuses)
        self.assertEqual(live, self.replay(meta, threads=1))
        self.assertEqual(live, self.replay(meta, threads=4))

    def test_every_option_of_a_fit_live_and_in_replay(self):
        configuration = small_instrument(LINES, COLUMNS)
        errors = {"frequency_hz": 1, "quality_factor": 2, "stiffness_n_per_m": 0.2, "sensitivity_nm_per_v": 0.01}
        modes = len(configuration["cantilever"]["modes"])
        configuration["cantilever"]["uncertainty"] = [{"std_errors": errors, "correlation": [0, 0, 0, 0, 0, -0.5]}] * modes
        daemon = self.daemon(configuration)
        control, watcher = daemon.client(), daemon.client()
        self.assertIn("no free response far from the surface", control.request("free.capture", lifted=True)["error"]["message"])
        far = control.call("free.capture", windows=8)
        self.assertNotIn("lifted_nm", far)
        lifted = control.call("free.capture", windows=8, lifted=True)
        self.assertEqual(far["mean_nm"], lifted["mean_nm"])
        for (re, im), (re_far, im_far) in zip(lifted["lifted_nm"], far["mean_nm"]):  # nothing but noise between them
            self.assertAlmostEqual(0, abs(complex(re, im) - complex(re_far, im_far)) / abs(complex(re_far, im_far)), delta=0.02)
        control.call("model.set", model="hertz", weighting="noise", calibration_errors=True, background="linear", compare=["cone"])
        watcher.call("subscribe", topics=["pixel"])
        meta = control.call("record.start", name="options")["meta_path"]
        control.call("scan.start", frames=1)
        live = pixel_lines(watcher, LINES * COLUMNS)
        control.call("record.stop")
        self.assertEqual(0, daemon.end(), daemon.log())
        fits = [json.loads(line)["params"]["fit"] for line in live]
        good = [fit for fit in fits if fit["status"] == "converged"]
        self.assertGreater(len(good), LINES * COLUMNS / 2, [fit["status"] for fit in fits])
        for fit in good:
            self.assertEqual(fit["parameters"].keys(), fit["calibration_errors"].keys())
            self.assertGreater(fit["calibration_errors"]["contact_strength_gpa_sqrt_nm"], 0)
            self.assertEqual(["cone"], list(fit["compared"]))
            self.assertGreater(fit["compared"]["cone"]["aicc"], 4)  # 2k of its two parameters at least
        self.assertEqual(live, self.replay(meta, threads=1))
        self.assertEqual(live, self.replay(meta, threads=4))
        # The two references differ by their noise alone, in digits that messages carry.
        plain = self.write("plain.json", json.dumps({"fit": {"model": "hertz", "weighting": "noise"}}))
        output = self.directory / "plain.ndjson"
        done = run(COMBFORCE, "replay", meta, "--config", plain, "--output", output)
        self.assertEqual(0, done.returncode, done.stderr)
        without = [json.loads(line)["params"]["fit"] for line in output.read_text().splitlines()]
        for fit, other in zip(fits, without):
            if fit["status"] == other["status"] == "converged":
                self.assertNotEqual(fit["parameters"], other["parameters"])
                self.assertNotIn("calibration_errors", other)
        # Another model than those it was compared with; a new reference far away does without the lifted one.
        self.assertEqual(0, run(COMBFORCE, "replay", meta, "--model", "cone", "--output", output).returncode)

    def test_refused_scan_changes_nothing(self):
        daemon, control, watcher = self.started()
        meta = control.call("record.start", name="refused")["meta_path"]
        error = control.request("scan.start", lines=1_000_000, columns=1_000_000)["error"]
        self.assertIn("1000000000000", error["message"])
        self.assertEqual(LINES, control.call("instrument.info")["scan"]["lines"])
        control.call("scan.start", frames=1)
        pixel_lines(watcher, LINES * COLUMNS)
        control.call("record.stop")
        daemon.end()
        with open(meta, encoding="utf-8") as file:
            written = json.load(file)
        self.assertEqual([], [capture for capture in written["captures"] if "afm:scan" in capture])
        self.assertEqual(LINES, written["global"]["afm:scan"]["lines"])

    def test_options_of_a_scan_are_its_own(self):
        _, control, watcher = self.started()
        control.call("subscribe", topics=["frame"])
        for options, pixels in [({"lines": 1, "columns": 3}, 3), ({"lines": 2}, 2 * COLUMNS), ({}, LINES * COLUMNS)]:
            control.call("scan.start", frames=1, **options)
            self.assertEqual(pixels, control.notification("frame")["counts"]["pixels"])
            wait_for(lambda: not control.call("instrument.status")["scanning"], "the end of the scan")
        pixel_lines(watcher, 3 + 2 * COLUMNS + LINES * COLUMNS)

    def test_capture_is_given_up_with_its_client(self):
        daemon = self.daemon(small_instrument(LINES, COLUMNS))
        control, impatient, halved = daemon.client(), daemon.client(), daemon.client()
        capture = json.dumps({"jsonrpc": "2.0", "id": "long", "method": "free.capture", "params": {"windows": 1000000}})

        def captured():
            return "result" in control.request("free.capture", windows=8)

        impatient.send(capture)
        impatient.call("instrument.status")  # requests of a client are taken in order
        self.assertFalse(captured())
        impatient.close()
        wait_for(captured, "the end of the long capture")
        halved.send(capture)
        halved.call("instrument.status")
        halved.socket.shutdown(socket.SHUT_WR)  # it still listens
        self.assertFalse(captured())
        control.call("free.cancel")
        self.assertEqual("it was cancelled", halved.message()["error"]["message"])
        wait_for(captured, "a capture")

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

    def test_signals_close_the_recording(self):
        # As Ctrl-C in a terminal does it: SIGINT to everyone, then SIGTERM from the script that started the daemon.
        daemon, control, watcher = self.started()
        meta = control.call("record.start", name="cut")["meta_path"]
        control.call("scan.start", frames=0)
        live = pixel_lines(watcher, 2 * COLUMNS)
        for sent in [signal.SIGINT, signal.SIGTERM, signal.SIGINT]:
            daemon.process.send_signal(sent)
        self.assertEqual(0, daemon.end(), daemon.log())
        with open(meta, encoding="utf-8") as file:
            self.assertIn("core:sha512", json.load(file)["global"])
        self.assertEqual(live, self.replay(meta)[:2 * COLUMNS])

    def test_what_was_measured_reaches_subscribers_at_the_end(self):
        daemon, control, watcher = self.started(lines=40, columns=40)
        watcher.call("subscribe", topics=["pixel", "event"])
        meta = control.call("record.start", name="ended")["meta_path"]
        control.call("scan.start", frames=1)
        received = [watcher.line() for _ in range(20)]
        daemon.process.send_signal(signal.SIGTERM)
        try:
            while True:
                received.append(watcher.line())
        except ConnectionError:
            pass
        self.assertEqual(0, daemon.end(), daemon.log())
        last = json.loads(received[-1])["params"]
        self.assertEqual(("stream_ended", 0), (last["kind"], last["count"]), daemon.log())
        with open(meta, encoding="utf-8") as file:
            first = json.load(file)["captures"][0]["core:global_index"]
        frames = (self.directory / "ended.sigmf-data").stat().st_size // 4  # two channels of two bytes
        self.assertEqual(last["first_sample"], first + frames, "analysed and recorded to the same end")
        live = [line for line in received if line.startswith(b'{"jsonrpc":"2.0","method":"pixel"')]
        self.assertEqual(live, self.replay(meta))

    def test_recording_begun_after_the_clock_broke(self):
        # The reference is older than the recording and of its epoch: replay must believe in it as live did.
        configuration = small_instrument(LINES, COLUMNS)
        configuration["digitizer"]["simulation"]["faults"] = [{"kind": "unknown_loss", "sample": 50000, "frames": 77}]
        daemon = self.daemon(configuration)
        control, watcher = daemon.client(), daemon.client()
        wait_for(lambda: control.call("instrument.status")["epoch"] == 1, "the new epoch")
        # What the digitizer has delivered waits in the ring: the break may still come to be analysed.
        wait_for(lambda: "result" in control.request("free.capture", windows=8), "a capture after the break")
        watcher.call("subscribe", topics=["pixel"])
        meta = control.call("record.start", name="late")["meta_path"]
        control.call("scan.start", frames=1)
        live = pixel_lines(watcher, LINES * COLUMNS)
        control.call("record.stop")
        self.assertEqual(0, daemon.end(), daemon.log())
        statuses = [json.loads(line)["params"]["fit"]["status"] for line in live]
        self.assertGreater(statuses.count("converged"), LINES * COLUMNS / 2, statuses)
        self.assertEqual(live, self.replay(meta))

    def test_free_response_that_drifts_between_captures(self):
        # A drive 0.2 ppm fast: 6 mrad of the 600 kHz tone in a capture of 8 ms, 0.75 rad in a second.
        configuration = small_instrument(LINES, COLUMNS)
        configuration["digitizer"]["simulation"]["faults"] = [{"kind": "detuned", "sample": 0, "detuning_ppm": 0.2}]
        daemon = self.daemon(configuration)
        control = daemon.client()
        control.call("subscribe", topics=["event"])
        first = control.call("free.capture", windows=8)
        later = first["first_sample"] + 5_000_000
        wait_for(lambda: control.call("instrument.status")["sample"] > later, "a second of the stream")
        second = control.call("free.capture", windows=8)
        event = control.notification("event")
        self.assertEqual(("incoherent", second["first_sample"]), (event["kind"], event["first_sample"]))
        self.assertIn(f"since sample {first['first_sample']}", event["text"])

    def test_incoherent_capture_is_an_error_and_an_event(self):
        configuration = small_instrument(LINES, COLUMNS)
        configuration["digitizer"]["simulation"]["faults"] = [{"kind": "detuned", "sample": 0, "detuning_ppm": 5}]
        daemon = self.daemon(configuration)
        control = daemon.client()
        control.call("subscribe", topics=["event"])
        error = control.request("free.capture", windows=8)["error"]
        self.assertIn("share no clock", error["message"])
        event = control.notification("event")
        self.assertEqual(("incoherent", error["message"]), (event["kind"], event["text"]))
        self.assertIn("warning incoherent", daemon.log())
        control.call("subscribe", topics=["pixel"])
        control.call("scan.start", frames=1)
        self.assertIn("incoherent", control.notification("pixel")["flags"])

    def test_capture_without_a_drive_warns(self):
        configuration = small_instrument(LINES, COLUMNS)
        configuration["digitizer"]["simulation"]["drive"] = {"scheme": "amplitudes", "amplitudes_nm": [0, 0]}
        daemon = self.daemon(configuration)
        control = daemon.client()
        control.call("subscribe", topics=["event"])
        control.call("free.capture", windows=8)
        event = control.notification("event")
        while event["kind"] != "warning":
            event = control.notification("event")
        self.assertIn("is noise", event["text"])
        self.assertIn("warning warning at", daemon.log())

    def test_capture_right_after_a_change_of_the_drive_is_of_the_new_one(self):
        control = self.daemon(small_instrument(LINES, COLUMNS)).client()
        # Windows of two drives mixed would miss by tens of percent; 2 % is far above thermal noise.
        for amplitudes in [[20, 10], [10, 5], [30, 2]]:
            control.call("drive.set", scheme="amplitudes", amplitudes_nm=amplitudes)
            captured = control.call("free.capture", windows=8)["mean_nm"]
            for (re, im), amplitude in zip(captured, amplitudes):
                self.assertAlmostEqual(amplitude, (re * re + im * im) ** 0.5, delta=0.02 * amplitude)

    def test_spectra_of_the_deflection(self):
        control = self.daemon(small_instrument(LINES, COLUMNS)).client()
        control.call("subscribe", topics=["spectrum"], spectrum_hz=10)
        spectra = [control.notification("spectrum") for _ in range(2)]
        for spectrum in spectra:
            self.assertEqual("nm^2/Hz", spectrum["unit"])
            density, bin_hz = spectrum["density"], spectrum["bin_hz"]
            self.assertEqual(8193, len(density))
            # The free motion of 100 kHz: 41 nm of the 50 nm that share their energy, k 4 and 80 N/m; a Hann window
            # spreads it over three bins.
            peak = round(100e3 / bin_hz)
            self.assertEqual(peak, density.index(max(density)))
            amplitude_nm = (2 * sum(density[peak - 2:peak + 3]) * bin_hz) ** 0.5
            self.assertAlmostEqual(50 / (1 + (4 / 80) ** 0.5), amplitude_nm, delta=0.1)
        self.assertGreater(spectra[1]["first_sample"], spectra[0]["first_sample"])

    def test_kill_while_recording(self):
        daemon, control, watcher = self.started()
        meta = self.directory / "killed.sigmf-meta"
        control.call("record.start", name="killed")
        control.call("scan.start", frames=0)

        def lines_on_disk():
            # Lines are marked as they begin: the last of a frame is whole when the next one is marked.
            return meta.exists() and len(json.loads(meta.read_text(encoding="utf-8"))["annotations"]) > LINES

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
