#!/usr/bin/env python3
"""include_order.py on made-up trees: each rule is broken once, and what is allowed stays unreported."""
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from include_order import violations  # noqa: E402


class IncludeOrder(unittest.TestCase):
    def check(self, files):
        with tempfile.TemporaryDirectory() as directory:
            for name, text in files.items():
                path = Path(directory, name)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text, encoding="utf-8")
            return list(violations(Path(directory)))

    def test_allowed(self):
        self.assertEqual([], self.check({
            "dsp/a.hpp": "#include <vector>\n#include <Eigen/Core>\n#include <boost/lockfree/spsc_queue.hpp>\n",
            "fit/b.cpp": '#include "dsp/a.hpp"\n#include <ceres/tiny_solver.h>\n',
            "drivers/c.cpp": '#include "fit/b.cpp"\n#include <thread>\n#include <sys/mman.h>\n',
            "daemon/pipeline/p.hpp": '#include "dsp/a.hpp"\n',
            "daemon/record/r.cpp": '#include "daemon/pipeline/p.hpp"\n#include <openssl/evp.h>\n',
            "daemon/i.hpp": '#include "daemon/pipeline/p.hpp"\n',
            "daemon/combforced.cpp": '#include "daemon/serve/s.cpp"\n#include <CLI/CLI.hpp>\n',
            "daemon/serve/s.cpp": '#include "daemon/i.hpp"\n#include <boost/asio.hpp>\n',
            "tests/t.cpp": '#include "../anything.hpp"\n#include <gtest/gtest.h>\n',
        }))

    def test_folder_to_the_right(self):
        self.assertEqual(['dsp/a.hpp: "fit/b.hpp": dsp may not include fit'],
                         self.check({"dsp/a.hpp": '#pragma once\n  #  include "fit/b.hpp"\n', "fit/b.hpp": ""}))

    def test_pipeline_and_recorder_know_no_server(self):
        for part in ["pipeline", "record"]:
            self.assertEqual(
                [f'daemon/{part}/a.cpp: "daemon/serve/s.hpp": daemon/{part} may not include daemon/serve'],
                self.check({f"daemon/{part}/a.cpp": '#include "daemon/serve/s.hpp"\n', "daemon/serve/s.hpp": ""}))

    def test_missing_relative_and_test_headers(self):
        for included in ["dsp/none.hpp", "a.hpp", "../dsp/a.hpp", "tests/t.hpp"]:
            found = self.check({"dsp/a.hpp": f'#include "{included}"\n', "tests/t.hpp": ""})
            self.assertEqual(1, len(found), included)
            self.assertIn("is no file of", found[0])

    def test_libraries(self):
        for file, included in [("daemon/pipeline/p.cpp", "boost/asio.hpp"), ("daemon/record/r.cpp", "spdlog/spdlog.h"),
                               ("drivers/d.cpp", "spdlog/spdlog.h"), ("dsp/a.cpp", "nlohmann/json.hpp"),
                               ("proto/p.cpp", "ceres/ceres.h"), ("dsp/a.cpp", "sys/mman.h")]:
            found = self.check({file: f"#include <{included}>\n"})
            self.assertEqual([f"{file}: <{included}>: {Path(file).parent} may not use it"], found)

    def test_unknown_library(self):
        self.assertEqual(["fit/a.cpp: <boost/units/io.hpp>: not on the list of libraries"],
                         self.check({"fit/a.cpp": "#include <boost/units/io.hpp>\n"}))

    def test_exceptions_hold_for_their_file_alone(self):
        self.assertEqual([], self.check({"dsp/fftw.hpp": "#include <mutex>\n"}))
        self.assertEqual(["dsp/a.hpp: <mutex>: dsp has no threads and no input or output"],
                         self.check({"dsp/a.hpp": "#include <mutex>\n"}))

    def test_threads_in_numerics(self):
        self.assertEqual(["dsp/a.hpp: <thread>: dsp has no threads and no input or output"],
                         self.check({"dsp/a.hpp": "#include <thread>\n"}))


if __name__ == "__main__":
    unittest.main()
