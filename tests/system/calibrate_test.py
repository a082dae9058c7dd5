#!/usr/bin/env python3
"""combforce calibrate thermal: from a file of densities, a recording and a daemon's stream to a configuration."""
import array
import json
import math
import random
import shutil
import unittest

from harness import COMBFORCE, COMBFORCED, SOURCE, SystemTest, run, small_instrument

VENDOR_FILE = SOURCE.parent / "shared" / "data" / "jpk_water_thermal.tnd"
BOLTZMANN = 1.380649e-23


def thermal_instrument():
    """The small instrument without drive, its first mode alone: nothing but heat and detector noise."""
    configuration = small_instrument()
    simulation = configuration["digitizer"]["simulation"]
    simulation.update(drive={"scheme": "amplitudes", "amplitudes_nm": [0]}, sample_rate_hz=1e6, volts_per_code=1e-6,
                      free_seconds=0.5, seed=11)
    configuration["cantilever"] = {"modes": [{"frequency_hz": 100e3, "quality_factor": 100, "stiffness_n_per_m": 4,
                                              "sensitivity_nm_per_v": 50}]}
    configuration["comb"] = {"window_samples": 1000, "tones": [{"bin": 10}]}
    configuration["scan"] = {"lines": 1, "columns": 1, "pixel_samples": 2000}
    simulation["feedback"] = {"enabled": False, "start_z_nm": 1000}
    return configuration


def oscillator(f, f0, quality, variance):
    """Density of the variance of one oscillator (V²/Hz, one-sided)."""
    return 2 * variance * f0**3 / (math.pi * quality) / ((f0**2 - f**2)**2 + (f * f0 / quality)**2)


class CalibrateTest(SystemTest):
    def thermal(self, *arguments):
        return run(COMBFORCE, "calibrate", "thermal", *arguments)

    def calibrated(self, *arguments):
        done = self.thermal(*arguments, "--json")
        self.assertEqual(0, done.returncode, done.stderr)
        return json.loads(done.stdout)

    def expect_within(self, calibration, truth, deviations=4):
        """Truth within so many error bars: a fixed seed, so it holds or it does not."""
        mode = calibration["cantilever"]["modes"][0]
        errors = calibration["cantilever"]["uncertainty"][0]["std_errors"]
        for key, value in truth.items():
            self.assertLess(abs(mode[key] - value), deviations * errors[key], (key, mode[key], errors[key]))
            self.assertLess(errors[key], 0.1 * value, key)

    def write_density(self, two_sided=False):
        draw = random.Random(4)
        rows = [(f, 1e-12 + oscillator(f, 50e3, 20, 3e-6)) for f in range(0, 200_000, 50)]
        scale = 0.5 if two_sided else 1.0
        return self.write("density.txt", "# Hz V2/Hz\n" + "".join(
            f"{f} {scale * density * draw.gammavariate(16, 1 / 16):.9g}\n" for f, density in rows))


class Densities(CalibrateTest):
    def test_text(self):
        """Stiffness from sensitivity; averages and quality factor are not told but found."""
        path = self.write_density()
        truth = {"frequency_hz": 50e3, "quality_factor": 20, "stiffness_n_per_m": BOLTZMANN * 300 / (30e-9**2 * 3e-6)}
        calibration = self.calibrated(path, "--mode", "47e3", "--sensitivity", "30", "--temperature", "300")
        self.expect_within(calibration, truth)
        # 300 bins within three widths of the peak: sqrt(2/300), four times.
        self.assertLess(abs(calibration["origin"]["averages"] / 16 - 1), 0.33)
        two_sided = self.calibrated(self.write_density(two_sided=True), "--two-sided", "--mode", "47e3",
                                    "--sensitivity", "30", "--temperature", "300")
        self.assertLess(abs(two_sided["cantilever"]["modes"][0]["stiffness_n_per_m"] /
                            calibration["cantilever"]["modes"][0]["stiffness_n_per_m"] - 1), 1e-5)

    def test_configuration_includes_what_is_written(self):
        self.assertEqual(0, self.thermal(self.write_density(), "--mode", "50e3:20", "--stiffness", "2", "--temperature",
                                         "300", "--output", self.directory / "probe.json").returncode)
        calibration = json.loads((self.directory / "probe.json").read_text(encoding="utf-8"))
        configuration = small_instrument()
        del configuration["cantilever"], configuration["noise"]
        configuration["calibration"] = "probe.json"
        done = run(COMBFORCED, "--config", self.write("daemon.json", configuration), "--print-config")
        self.assertEqual(0, done.returncode, done.stderr)
        printed = json.loads(done.stdout)
        self.assertEqual(calibration["cantilever"], printed["cantilever"])
        self.assertEqual(calibration["noise"], printed["noise"])
        self.assertEqual(2, printed["cantilever"]["modes"][0]["stiffness_n_per_m"])

    def test_plot(self):
        if shutil.which("gnuplot") is None:
            self.skipTest("no gnuplot")
        table, picture = self.directory / "table.txt", self.directory / "thermal.png"
        self.assertEqual(0, self.thermal(self.write_density(), "--mode", "50e3", "--table", table).returncode)
        done = run("gnuplot", "-e", f"table='{table}'; picture='{picture}'", SOURCE / "plots" / "thermal.gp")
        self.assertEqual((0, ""), (done.returncode, done.stderr))
        self.assertGreater(picture.stat().st_size, 5000)

    @unittest.skipUnless(VENDOR_FILE.exists(), "the reference data are not beside the project")
    def test_vendor_file(self):
        calibration = self.calibrated(VENDOR_FILE, "--correction-factor", "0.9")
        vendor = calibration["origin"]["vendor"]
        self.assertLess(abs(vendor["by_our_formula_n_per_m"] / 45.87e-3 - 1), 0.005)
        self.expect_within(calibration, {"stiffness_n_per_m": 45.87e-3}, 2)
        # The raw column is one periodogram: bins scatter as exponential variables do.
        self.assertLess(abs(calibration["origin"]["averages"] - 1), 0.1)

    @unittest.skipUnless(VENDOR_FILE.exists(), "the reference data are not beside the project")
    def test_correction_factors_are_spoken_of(self):
        hint = "the vendor's correction factor is 0.9, not 1 as here: --correction-factor 0.9"
        other = "with a correction factor of 0.9 stiffness is not that of the mode"
        modal = self.thermal(VENDOR_FILE).stderr
        self.assertIn(hint, modal)
        self.assertNotIn(other, modal)
        vendors = self.thermal(VENDOR_FILE, "--correction-factor", "0.9").stderr
        self.assertIn(other, vendors)
        self.assertNotIn(hint, vendors)

    def test_detector_noise_is_the_floor_that_is_known(self):
        """A floor below 0 under the first mode; under the second 1e-12 V²/Hz, with 30 nm/V 30 fm/√Hz."""
        draw = random.Random(5)
        density = [(f, oscillator(f, 50e3, 20, 3e-6) - 1e-13 if f < 100e3 else 1e-12 + oscillator(f, 300e3, 60, 1e-7))
                   for f in range(10_000, 400_000, 50)]
        path = self.write("two.txt", "".join(f"{f} {s * draw.gammavariate(16, 1 / 16):.9g}\n" for f, s in density))
        arguments = [path, "--mode", "50e3:20", "--band", "20e3:90e3", "--sensitivity", "30", "--temperature", "300"]
        both = self.calibrated(*arguments, "--mode", "300e3:60", "--band", "250e3:350e3")
        # The floor's standard error is about 3 %, half of that in nm; seven times.
        self.assertLess(abs(both["noise"]["detector_nm_per_sqrt_hz"] / 30e-6 - 1), 0.1)
        first = self.thermal(*arguments)
        self.assertIn("no fit tells the floor: detector noise is 0", first.stderr)

    def test_help_names_the_scalings(self):
        self.assertIn("--scaling TEXT:{stiffness,sensitivity}", self.thermal("--help").stdout)

    def test_bad_input(self):
        path = self.write_density()
        tone = self.write("tone.txt", "".join(f"{50 * i} {1e-6 if i == 1000 else 1e-12}\n" for i in range(2000)))
        cases = [
            ([tone, "--mode", "5e4:20"], 3, f"{tone}: the peak at 50000 Hz is"),
            ([self.directory / "none.txt", "--mode", "5e4"], 3, "none.txt: cannot be read"),
            ([self.write("bad.txt", "1 2\n2 x\n"), "--mode", "5e4"], 3, "bad.txt: line 2: column 2 is \"x\""),
            ([path], 3, "--mode: absent"),
            ([path, "--mode", "5e4", "--sensitivity", "30"], 3, "--temperature: absent"),
            ([path, "--mode", "five"], 3, "--mode: \"five\", must be FREQUENCY or FREQUENCY:Q"),
            ([path, "--mode", "5e4", "--band", "6e4:4e4"], 3, "--band: \"6e4:4e4\", LOW must be below HIGH"),
            ([path, "--mode", "5e4", "--band", "6e4:7e4"], 3, "within the band 60000 to 70000 Hz"),
            ([path, "--mode", "5e4", "--exclude", "1"], 3, "--exclude: \"1\", must be LOW:HIGH"),
            ([path, "--mode", "4.9e4:20", "--mode", "5.1e4:20"], 3,
             "--mode: modes 1 and 2 were both found at "),
            ([path, "--mode", "9e5"], 3, "the spectrum has nothing there"),
            ([path, "--mode", "5e4", "--output", "-"], 3, "--output: needs --sensitivity"),
            ([path, "--mode", "5e4", "--sader", "--temperature", "300"], 2, "--sader requires --"),
            ([path, "--mode", "5e4", "--sensitivity", "-1"], 2, "--sensitivity: -1, must be a number above 0"),
            ([path, "--mode", "5e4", "--stiffness", "1", "2", "--temperature", "300"], 3,
             "--stiffness: 2 values, must be one, or 1"),
            ([path, "--mode", "5e4", "--sader", "--stiffness", "2"], 2, "excludes"),
            ([path, "--mode", "5e4", "--stiffness", "2", "--temperature", "-3"], 2, "--temperature"),
            ([path, "--mode", "5e4", "--averages", "0"], 2, "--averages"),
        ]
        for arguments, code, said in cases:
            done = self.thermal(*arguments)
            self.assertEqual(code, done.returncode, (arguments, done.stderr))
            self.assertIn(said, done.stderr)


class Streams(CalibrateTest):
    def test_recording(self):
        recording = self.directory / "thermal"
        done = run(COMBFORCE, "simulate", "--config", self.write("thermal.json", thermal_instrument()), "--output",
                   recording)
        self.assertEqual(0, done.returncode, done.stderr)
        meta = f"{recording}.sigmf-meta"
        truth = {"frequency_hz": 100e3, "quality_factor": 100}
        by_sensitivity = self.calibrated(meta, "--sensitivity", "50")
        self.expect_within(by_sensitivity, dict(truth, stiffness_n_per_m=4))
        by_stiffness = self.calibrated(meta, "--stiffness", "4", "--mode", "97e3")
        self.expect_within(by_stiffness, dict(truth, sensitivity_nm_per_v=50))
        # 1e-4 nm/√Hz of detector noise.
        self.assertLess(abs(by_sensitivity["noise"]["detector_nm_per_sqrt_hz"] / 1e-4 - 1), 0.1)
        # A stream that did not begin with the recording: the samples count, not where they end.
        later = json.loads((self.directory / "thermal.sigmf-meta").read_text(encoding="utf-8"))
        later.update(captures=[{"core:sample_start": 0, "core:global_index": 7_000_000}], annotations=[])
        data = self.directory / "later.sigmf-data"
        data.hardlink_to(self.directory / "thermal.sigmf-data")
        frames = data.stat().st_size // 4  # two channels
        done = self.thermal(self.write("later.sigmf-meta", later), "--segment", frames + 2)  # even
        self.assertEqual(3, done.returncode, done.stderr)
        self.assertIn(f": {frames} samples, no stretch of them as long as a segment", done.stderr)

    def test_clipped_recording(self):
        configuration = thermal_instrument()
        # sqrt(kB T/k) = 32 pm of heat are 0.64 mV, full scale is 0.66 mV.
        configuration["digitizer"]["simulation"].update(volts_per_code=2e-8)
        recording = self.directory / "clipped"
        done = run(COMBFORCE, "simulate", "--config", self.write("clipped.json", configuration), "--output", recording)
        self.assertEqual(0, done.returncode, done.stderr)
        done = self.thermal(recording, "--sensitivity", "50", "--json")
        self.assertEqual(0, done.returncode, done.stderr)
        data = array.array("h", (self.directory / "clipped.sigmf-data").read_bytes())[::2]  # beside z
        clipped = sum(code in (-32768, 32767) for code in data)
        self.assertGreater(clipped, 0)
        self.assertEqual(clipped, json.loads(done.stdout)["origin"]["clipped"])
        self.assertIn(f"{clipped} of {len(data)} samples are clipped", done.stderr)

    def test_recording_with_the_drive_on(self):
        """A tone is no oscillator: the message says which file, and what to do."""
        configuration = thermal_instrument()
        configuration["digitizer"]["simulation"].update(drive={"scheme": "amplitudes", "amplitudes_nm": [20]},
                                                        volts_per_code=0)
        configuration["comb"]["tones"] = [{"bin": 100}]  # 100 kHz
        recording = self.directory / "driven"
        done = run(COMBFORCE, "simulate", "--config", self.write("driven.json", configuration), "--output", recording)
        self.assertEqual(0, done.returncode, done.stderr)
        done = self.thermal(recording, "--sensitivity", "50")
        self.assertEqual(3, done.returncode, done.stderr)
        self.assertIn(f"{recording}.sigmf-meta: the peak at ", done.stderr)
        self.assertIn("record with the drive off", done.stderr)

    def test_live(self):
        daemon = self.daemon(thermal_instrument())
        done = daemon.command("calibrate", "thermal", "--seconds", "0.5", "--sensitivity", "50", "--json")
        self.assertEqual(0, done.returncode, done.stderr + daemon.log())
        # Where the recording begins is left to chance, hence the draw: five error bars.
        self.expect_within(json.loads(done.stdout), {"frequency_hz": 100e3, "quality_factor": 100,
                                                     "stiffness_n_per_m": 4}, 5)


if __name__ == "__main__":
    unittest.main()
