#!/usr/bin/env python3
"""combforce paper, few draws: what it writes and prints. Its numbers are tests/integration/paper_study_test's."""
import json
import shutil
import unittest

from harness import COMBFORCE, SystemTest, run


class Paper(SystemTest):
    def test_writes_tables_data_and_figures(self):
        output, tables = self.directory / "paper", self.directory / "tables.json"
        done = run(COMBFORCE, "paper", "--draws", 3, "--output", output, "--json", tables, timeout=500)
        self.assertEqual(0, done.returncode, done.stderr)
        self.assertEqual(done.stdout, (output / "paper.md").read_text())
        for title in ["Hertz (table 2)", "DMT (table 3)", "Error map", "Force curves", "The simulator", "Motion"]:
            self.assertIn(f"## {title}", done.stdout)
        read = json.loads(tables.read_text())
        self.assertEqual(3, read["conditions"]["draws"])
        self.assertEqual(5, len(read["tables"]))
        if shutil.which("gnuplot"):
            for figure in ["error_map.svg", "force_curves.svg", "motion.svg", "simulator_check.png"]:
                self.assertGreater((output / figure).stat().st_size, 10000, figure)

    def test_beyond_writes_tables_data_and_a_figure(self):
        output, tables = self.directory / "beyond", self.directory / "beyond.json"
        done = run(COMBFORCE, "paper", "--beyond", "--pixels", 3, "--output", output, "--json", tables, timeout=500)
        self.assertEqual(0, done.returncode, done.stderr)
        self.assertEqual(done.stdout, (output / "beyond.md").read_text())
        read = json.loads(tables.read_text())
        self.assertEqual(5, len(read["bias"]))
        for row in read["bias"]:  # DMT at equal amplitude is the worst conditioned
            share = 1e-3 if row["case"] == "dmt_4tone_equal_amplitude" else 2e-4
            for name, truth in row["truth"].items():
                bound = 1e-3 if name == "surface_position_nm" else share * truth
                self.assertLess(abs(row["refined"][name] - truth), bound, (row["case"], name))
        self.assertEqual([3] * 6, [row["pixels"] for row in read["coverage"]])
        if shutil.which("gnuplot"):
            self.assertGreater((output / "bias.svg").stat().st_size, 5000)

    def test_draws_out_of_range_are_a_usage_error(self):
        for draws in [1, 101]:
            self.assertEqual(2, run(COMBFORCE, "paper", "--draws", draws).returncode)

    def test_unwritable_output_is_told_at_once(self):
        done = run(COMBFORCE, "paper", "--json", self.directory / "none" / "tables.json")
        self.assertEqual(1, done.returncode)
        self.assertIn("none/tables.json", done.stderr)


if __name__ == "__main__":
    unittest.main()
