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

    def test_draws_out_of_range_are_a_usage_error(self):
        for draws in [1, 101]:
            self.assertEqual(2, run(COMBFORCE, "paper", "--draws", draws).returncode)

    def test_unwritable_output_is_told_at_once(self):
        done = run(COMBFORCE, "paper", "--json", self.directory / "none" / "tables.json")
        self.assertEqual(1, done.returncode)
        self.assertIn("none/tables.json", done.stderr)


if __name__ == "__main__":
    unittest.main()
