#!/usr/bin/env python3
"""Both programs' --help, --version and exit statuses, and what --check-config says of bad configurations."""
import json
import math
import unittest

from harness import COMBFORCE, COMBFORCED, SOURCE, SystemTest, run, small_instrument

SUBCOMMANDS = [["replay"], ["simulate"], ["paper"], ["status"], ["watch"], ["scan", "start"], ["scan", "stop"],
               ["record", "start"], ["record", "stop"], ["free"], ["calibrate", "thermal"], ["drive", "design"]]


class CommandLine(SystemTest):
    def test_help(self):
        for command in [[COMBFORCED], [COMBFORCE], *([COMBFORCE, *words] for words in SUBCOMMANDS)]:
            done = run(*command, "--help")
            self.assertEqual((0, ""), (done.returncode, done.stderr), command)
            self.assertIn("--help", done.stdout)

    def test_version(self):
        for program in [COMBFORCED, COMBFORCE]:
            done = run(program, "--version")
            self.assertEqual(0, done.returncode)
            self.assertRegex(done.stdout, r"\d+\.\d+\.\d+\n$")

    def test_usage_errors_end_with_2(self):
        for command in [[COMBFORCED, "--no-such-option"], [COMBFORCE], [COMBFORCE, "no-such-command"],
                        [COMBFORCE, "replay"], [COMBFORCE, "replay", "x.sigmf-meta", "--refine", "many"],
                        [COMBFORCE, "replay", "x.sigmf-meta", "--refine", "101"]]:
            done = run(*command)
            self.assertEqual(2, done.returncode, command)
            self.assertNotEqual("", done.stderr, command)

    def test_usage_errors_name_what_is_wrong(self):
        for arguments, said in [(["bogus"], "bogus: is no subcommand"), (["scan", "bogus"], "bogus: is no subcommand"),
                                (["scan", "start", "--lines", "0"], "--lines: 0, must be a number above 0"),
                                (["watch", "--count", "-1"], "--count: -1, must be a number above 0"),
                                (["calibrate", "thermal", "--temperature", "inf"], "--temperature: inf, must be"),
                                (["drive", "design", "--config", "x", "--parameters", "1", "--model", "spring"], "spring"),
                                (["status", "--connect", "127.0.0.1:99999"], "port 99999, must be 1..65535")]:
            done = run(COMBFORCE, *arguments)
            self.assertEqual(2, done.returncode, (arguments, done.stderr))
            self.assertIn(said, done.stderr)
            self.assertLess(max(map(len, done.stderr.split())), 40, done.stderr)  # no bound of 309 digits

    def test_no_daemon_ends_with_1(self):
        socket = self.directory / "nobody.sock"
        done = run(COMBFORCE, "status", "--connect", f"unix:{socket}")
        self.assertEqual(1, done.returncode)
        self.assertIn(str(socket), done.stderr)

    def test_drive_design_adds_tones_that_sharpen(self):
        config = SOURCE / "config" / "demo.json"
        asked = [COMBFORCE, "drive", "design", "--config", config, "--parameters=-40,1,5,0.5", "--tones", 1]
        done = run(*asked, "--json", timeout=300)
        self.assertEqual(0, done.returncode, done.stderr)
        design = json.loads(done.stdout)
        self.assertEqual(30, design["refine"])
        self.assertEqual(0.5, design["parameters"]["contact_distance_nm"])
        [tone] = design["added"]
        self.assertEqual(1e3 * tone["bin"], tone["frequency_hz"])
        shares = [tone["std_errors"][name] / design["std_errors"][name] for name in design["parameters"]]
        self.assertLess(math.prod(shares), 0.5)
        small = self.write("daemon.json", json.dumps(small_instrument()))
        table = run(COMBFORCE, "drive", "design", "--config", small, "--parameters=-40,1", "--tones", 2).stdout
        self.assertIn("contact_strength_gpa_sqrt_nm", table)
        self.assertEqual(2, table.count("+ bin"))

    def test_drive_design_refuses_what_it_cannot_use(self):
        config = self.write("daemon.json", json.dumps(small_instrument()))
        foreign = self.write("foreign.json", "{}")
        for arguments, said in [(["--config", config, "--model", "dmt", "--parameters", "1,2,3"], "3 values, must be 4: surface_position_nm"),
                                (["--config", config, "--parameters=-40,-1"], "contact_strength_gpa_sqrt_nm is -1"),
                                (["--config", config, "--parameters=-90,1"], "does not touch"),
                                (["--config", config, "--parameters=-40,1", "--sample-rate", 1e6], "has its own"),
                                (["--config", foreign, "--parameters=-40,1,5,0.5"], "--sample-rate"),
                                (["--config", foreign, "--parameters=-40,1,5,0.5", "--sample-rate", 1e6], "/comb: is missing")]:
            done = run(COMBFORCE, "drive", "design", *arguments, timeout=300)
            self.assertEqual(3, done.returncode, (arguments, done.stdout))
            self.assertIn(said, done.stderr)

    def test_missing_input_ends_with_3(self):
        missing = self.directory / "none.sigmf-meta"
        for command in [[COMBFORCE, "replay", missing], [COMBFORCED, "--config", missing, "--check-config"]]:
            done = run(*command)
            self.assertEqual(3, done.returncode, command)
            self.assertIn(str(missing), done.stderr)


class Configurations(SystemTest):
    def check(self, text):
        path = self.write("daemon.json", text)
        return path, run(COMBFORCED, "--config", path, "--check-config")

    def refused(self, text, *said):
        path, done = self.check(text)
        self.assertEqual(3, done.returncode, done.stderr)
        for part in [str(path), *said]:
            self.assertIn(part, done.stderr)

    def test_good(self):
        _, done = self.check(json.dumps(small_instrument()))
        self.assertEqual(0, done.returncode, done.stderr)

    def test_comments(self):
        _, done = self.check("// mine\n" + json.dumps(small_instrument()))
        self.assertEqual(0, done.returncode, done.stderr)

    def test_printed_configuration_is_the_same_again(self):
        path = self.write("daemon.json", small_instrument())
        first = run(COMBFORCED, "--config", path, "--print-config")
        self.assertEqual(0, first.returncode, first.stderr)
        again = run(COMBFORCED, "--config", self.write("printed.json", first.stdout), "--print-config")
        self.assertEqual((0, first.stdout), (again.returncode, again.stdout))

    def test_unknown_key(self):
        self.refused(dict(small_instrument(), comb_teeth=3), "comb_teeth")
        bad = small_instrument()
        bad["digitizer"]["simulation"]["scene"]["colour"] = "red"
        self.refused(bad, "/digitizer/simulation/scene", "colour")

    def test_duplicate_key(self):
        text = json.dumps(small_instrument())
        self.refused(text[:-1] + ', "log_level": "info"}', "log_level")

    def test_wrong_type(self):
        self.refused(dict(small_instrument(), pipeline={"threads": "two"}), "/pipeline/threads", "two")

    def test_out_of_range(self):
        bad = small_instrument()
        bad["cantilever"]["modes"][1]["quality_factor"] = -300.5
        self.refused(bad, "/cantilever/modes/1/quality_factor", "-300.5", "0")
        bad = small_instrument()
        bad["scan"]["pixel_samples"] = 9999
        self.refused(bad, "/scan", "pixel_samples", "9999", "10000")

    def changed(self, **simulation):
        """The small instrument with a simulation that its keys contradict."""
        configuration = small_instrument()
        configuration["digitizer"]["simulation"].update(simulation)
        return configuration

    def test_what_cannot_run(self):
        section = "/digitizer/simulation"
        blend = {"kind": "blend", "materials": [{"contact_strength_gpa_sqrt_nm": 1.0}] * 2, "domain_nm": 1}
        strong = {"scheme": "equal_energy", "total_amplitude_nm": 1e300}
        layout = {"lines": 4, "columns": 8, "pixel_samples": 10000, "size_nm": [1000, 1000]}
        cases = [
            (self.changed(scene=blend, scan=layout), f"{section}/scan/size_nm/0: 1000, must be > 0 and < 1000"),
            (self.changed(free_seconds=1e30), f"{section}/free_seconds: 1e+30, must be >= 0 and <= 4294967.295"),
            (self.changed(drive=strong), f"{section}/drive: "),
            (small_instrument(1 << 20, 1 << 20), "/scan: lines * columns = 1099511627776, must be <= 4194304"),
            (dict(small_instrument(), pipeline={"ring_blocks": 1 << 20}), "/pipeline/ring_blocks: 1048576, must be <="),
        ]
        for configuration, said in cases:
            configuration["server"] = {"unix_socket": str(self.directory / "combforce.sock"), "port": 0}
            self.refused(json.dumps(configuration), said)
            started = run(COMBFORCED, "--config", self.directory / "daemon.json")
            self.assertEqual(3, started.returncode, started.stderr)
            self.assertIn(f"daemon.json: {said}", started.stderr)

    def test_what_cannot_be_simulated_leaves_no_files(self):
        maps = {"kind": "maps", "height_map": "none.gsf",
                "parameter_maps": {"contact_strength_gpa_sqrt_nm": "none.gsf"}}
        for configuration, said in [(self.changed(scene=maps), "none.gsf"), (self.changed(free_seconds=1e30), "1e+30"),
                                    ({"comb": small_instrument()["comb"]}, "/digitizer: is missing")]:
            path = self.write("simulation.json", configuration)
            done = run(COMBFORCE, "simulate", "--config", path, "--output", self.directory / "s")
            self.assertEqual(3, done.returncode, done.stderr)
            self.assertIn(said, done.stderr)
            self.assertEqual([path], list(self.directory.iterdir()))
        _, done = self.check(json.dumps(self.changed(scene=maps)))
        self.assertEqual(3, done.returncode, done.stderr)
        self.assertIn("none.gsf: cannot be read", done.stderr)

    def test_what_is_hardly_meant_is_said(self):
        configuration = small_instrument()
        _, done = self.check(json.dumps(configuration))
        self.assertEqual("", done.stderr)
        configuration["fit"] = {"model": "dmt"}  # four parameters of two tones: determined, if badly
        _, done = self.check(json.dumps(configuration))
        self.assertEqual((0, ""), (done.returncode, done.stderr))
        configuration["comb"]["tones"] = [{"bin": 100}]
        _, done = self.check(json.dumps(configuration))
        self.assertEqual(0, done.returncode, done.stderr)
        self.assertIn("fit: model dmt has 4 parameters, and the comb tells 2 numbers", done.stderr)

    def test_malformed(self):
        self.refused('{"log_level": ', "line 1")


if __name__ == "__main__":
    unittest.main()
