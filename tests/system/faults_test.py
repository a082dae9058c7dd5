#!/usr/bin/env python3
"""`combforce simulate` with faults on request, then `combforce replay`: each is seen, and by the right pixels alone."""
import json
import unittest

from harness import COMBFORCE, PIXEL_SAMPLES, SystemTest, run, small_instrument

LINES, COLUMNS = 4, 8


class Faults(SystemTest):
    def simulate(self, fault):
        """Records a scan with one fault; gives the metadata and the replayed pixels."""
        configuration = small_instrument(LINES, COLUMNS)
        simulation = configuration["digitizer"]["simulation"]
        # The scan begins when the free response is known, at most a full ring (8000 samples) after it was measured.
        simulation.update({"free_seconds": 0.008, "block_frames": 1000, "faults": [fault]})
        configuration["pipeline"] = {"ring_blocks": 8}
        recording = self.directory / "faulty"
        done = run(COMBFORCE, "simulate", "--config", self.write("simulation.json", configuration), "--output",
                   recording)
        self.assertEqual(0, done.returncode, done.stderr)
        output = self.directory / "pixels.ndjson"
        done = run(COMBFORCE, "replay", f"{recording}.sigmf-meta", "--output", output)
        self.assertEqual(0, done.returncode, done.stderr)
        pixels = [json.loads(line)["params"] for line in output.read_text(encoding="utf-8").splitlines()]
        meta = json.loads((self.directory / "faulty.sigmf-meta").read_text(encoding="utf-8"))
        return meta, pixels

    def assert_flagged(self, pixels, flag, first, end, skipped=0):
        """`flag` is on exactly the pixels that [first, end) touches, their first `skipped` samples left out."""
        self.assertEqual(LINES * COLUMNS, len(pixels))
        touched = [pixel["first_sample"] for pixel in pixels
                   if pixel["first_sample"] + skipped < end and pixel["first_sample"] + PIXEL_SAMPLES > first]
        self.assertNotEqual([], touched)
        self.assertEqual(touched, [pixel["first_sample"] for pixel in pixels if flag in pixel["flags"]])
        for pixel in pixels:
            if flag in pixel["flags"]:
                self.assertEqual(("flagged", None), (pixel["fit"]["status"], pixel["fit"]["parameters"]))

    def test_lost_block(self):
        first, frames = 200123, 12345
        meta, pixels = self.simulate({"kind": "lost_block", "sample": first, "frames": frames})
        self.assert_flagged(pixels, "gap", first, first + frames)
        captures = [(capture["core:sample_start"], capture["core:global_index"]) for capture in meta["captures"]]
        self.assertIn((first, first + frames), captures)

    def test_clipped(self):
        first, frames = 204000, PIXEL_SAMPLES // 2 + 500  # more than settles: it reaches an analysed window
        _, pixels = self.simulate({"kind": "clipped", "sample": first, "frames": frames})
        self.assert_flagged(pixels, "clipped", first, first + frames, skipped=PIXEL_SAMPLES // 2)

    def test_unknown_loss(self):
        first, frames = 200123, 12345
        _, pixels = self.simulate({"kind": "unknown_loss", "sample": first, "frames": frames})
        after = [pixel for pixel in pixels if pixel["first_sample"] >= first + frames]
        self.assertNotEqual([], after)
        self.assertEqual({"no_free_response"}, {pixel["fit"]["status"] for pixel in after if not pixel["flags"]})

    def test_detuned_drive(self):
        # 5 ppm of 600 kHz turn by 0.13 rad while the free response is captured, eight windows: no force holds.
        _, pixels = self.simulate({"kind": "detuned", "sample": 0, "detuning_ppm": 5})
        self.assertEqual(LINES * COLUMNS, len(pixels))
        for pixel in pixels:
            self.assertIn("incoherent", pixel["flags"])  # the first of a line is settling, too
            self.assertEqual(("flagged", None), (pixel["fit"]["status"], pixel["fit"]["parameters"]))

    def test_drive_detuned_too_little_to_matter(self):
        # 0.1 ppm turn by 3 mrad in the capture: below the tolerance of 10 mrad.
        _, pixels = self.simulate({"kind": "detuned", "sample": 0, "detuning_ppm": 0.1})
        self.assertEqual([], [pixel for pixel in pixels if "incoherent" in pixel["flags"]])

    def test_stall(self):
        _, pixels = self.simulate({"kind": "stall", "sample": 200000, "duration_s": 0.3})
        self.assertEqual(LINES * COLUMNS, len(pixels))
        self.assertEqual([], [pixel for pixel in pixels if "gap" in pixel["flags"]])


if __name__ == "__main__":
    unittest.main()
