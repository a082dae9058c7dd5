#!/usr/bin/env python3
"""Recordings under a configuration that says something else: another calibration, another comb."""
import json
import unittest

from harness import COMBFORCE, SystemTest, run, small_instrument


class Configured(SystemTest):
    """A recorded scan of a flat surface, free response included."""

    def setUp(self):
        super().setUp()
        self.instrument = small_instrument(2, 4)
        configuration = self.write("small.json", self.instrument)
        done = run(COMBFORCE, "simulate", "--config", configuration, "--output", self.directory / "small")
        self.assertEqual(0, done.returncode, done.stderr)

    def replay(self, configuration):
        path = self.write("other.json", configuration)
        done = run(COMBFORCE, "replay", self.directory / "small", "--config", path, "--output", "-")
        self.assertEqual(0, done.returncode, done.stderr)
        return [json.loads(line)["params"] for line in done.stdout.splitlines()]

    @staticmethod
    def tones(pixel):
        return [complex(re, im) for re, im in zip(pixel["tones"]["re_nm"], pixel["tones"]["im_nm"])]

    def test_another_sensitivity_scales_lengths_and_forces(self):
        # Twice as many nm a volt: every length doubles, and with the stiffness kept every force. So a Hertzian
        # contact F = p1 (p0 - d)^(3/2) has its surface twice as low, and p1 sqrt(2) times smaller, exactly.
        # Of the free response the recording alone knows.
        recorded = self.replay({})
        modes = [dict(mode, sensitivity_nm_per_v=2 * mode.get("sensitivity_nm_per_v", 1))
                 for mode in self.instrument["cantilever"]["modes"]]
        scaled = self.replay({"cantilever": {"modes": modes}})
        self.assertEqual(8, len(scaled))
        self.assertIn("converged", [pixel["fit"]["status"] for pixel in recorded])
        for one, other in zip(recorded, scaled):
            for before, after in zip(self.tones(one), self.tones(other)):
                self.assertLess(abs(after / before - 2), 1e-6)
            if one["fit"]["status"] != "converged":
                continue
            self.assertEqual("converged", other["fit"]["status"])
            before, after = one["fit"]["parameters"], other["fit"]["parameters"]
            # Both fits stop within 1e-5 of their minima.
            self.assertAlmostEqual(2, after["surface_position_nm"] / before["surface_position_nm"], delta=1e-4)
            self.assertAlmostEqual(2**-0.5, after["contact_strength_gpa_sqrt_nm"] / before["contact_strength_gpa_sqrt_nm"],
                                   delta=1e-4)

    def test_another_order_of_the_tones(self):
        comb = dict(self.instrument["comb"], tones=self.instrument["comb"]["tones"][::-1])
        for one, other in zip(self.replay({}), self.replay({"comb": comb})):
            self.assertEqual(self.tones(one), self.tones(other)[::-1])
            self.assertEqual(one["fit"]["status"], other["fit"]["status"])
            for name, value in (one["fit"]["parameters"] or {}).items():
                self.assertAlmostEqual(1, other["fit"]["parameters"][name] / value, delta=1e-4)

    def test_a_tone_that_the_free_response_lacks(self):
        comb = dict(self.instrument["comb"], tones=[{"bin": 100}, {"bin": 500, "driven": False}])
        statuses = {pixel["fit"]["status"] for pixel in self.replay({"comb": comb})}
        self.assertIn("no_free_response", statuses)
        self.assertLessEqual(statuses, {"no_free_response", "flagged"})  # as the cantilever settles


if __name__ == "__main__":
    unittest.main()
