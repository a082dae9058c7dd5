#!/usr/bin/env python3
"""include_order.py ROOT: checks the #include lines of a source tree against the order of its folders.

A file includes its own folder and those to its left; quoted includes are written from the root of the tree and
exist; of libraries a folder includes only those it may use. Prints one line a violation; exit status 1 if any.
"""
import re
import sys
from pathlib import Path

# From left to right. The daemon's parts are ordered too: the pipeline and the recorder know of no server.
FOLDERS = ["dsp", "fit", "proto", "drivers", "config", "daemon/pipeline", "daemon/record", "daemon", "daemon/serve",
           "daemon/cli"]
PROGRAMS = {"daemon/combforce.cpp", "daemon/combforced.cpp"}  # the two mains: to the right of everything

LIBRARIES = {
    "Eigen/": {"dsp", "fit", "daemon/cli"},
    "unsupported/Eigen/": {"daemon/cli"},  # MINPACK, translated
    "fftw3.h": {"dsp"},
    "hwy/": {"dsp"},
    "boost/lockfree/": {"dsp", "daemon/pipeline"},
    "boost/math/": {"fit", "drivers"},
    "ceres/": {"fit"},
    "nlohmann/": {"proto", "config"},
    "libusb-1.0/": {"drivers"},
    "openssl/": {"daemon/record", "drivers"},  # sha512 of recordings: written, and checked while read
    "boost/asio": {"daemon/serve", "daemon/cli"},
    "boost/beast": {"daemon/serve"},
    "boost/system": {"daemon/serve", "daemon/cli"},
    "spdlog/": {"daemon", "daemon/serve", "daemon/cli"},
    "CLI/": {"daemon/cli"},
    "fmt/": set(FOLDERS),  # g++ 12 has no std::format
}

# No threads and no input or output where only samples and numbers belong.
NOT_IN_NUMERICS = {"thread", "mutex", "shared_mutex", "condition_variable", "future", "iostream", "fstream", "cstdio",
                   "filesystem"}
NUMERICS = {"dsp", "fit"}
# FFTW plans: process-wide state.
EXCEPTIONS = {(file, "mutex") for file in ("dsp/fftw.hpp", "fit/cell_transform.cpp")}

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.MULTILINE)


def folder_of(path):
    """The entry of FOLDERS that a path lies in: the longest that fits; None outside all."""
    fitting = [folder for folder in FOLDERS if path.startswith(folder + "/")]
    return max(fitting, key=len, default=None)


def check_quoted(root, folder, name, included):
    target = folder_of(included)
    if target is None or not (root / included).is_file():
        return f'"{included}" is no file of {", ".join(FOLDERS)}'
    if name not in PROGRAMS and FOLDERS.index(target) > FOLDERS.index(folder):
        return f'"{included}": {folder} may not include {target}'
    return None


def check_angled(folder, name, included):
    if "." not in included and "/" not in included:
        if folder in NUMERICS and included in NOT_IN_NUMERICS and (name, included) not in EXCEPTIONS:
            return f"<{included}>: {folder} has no threads and no input or output"
        return None
    for prefix, allowed in LIBRARIES.items():
        if included.startswith(prefix):
            return None if folder in allowed or name in PROGRAMS else f"<{included}>: {folder} may not use it"
    if included.endswith(".h") and not included.startswith("boost"):
        return f"<{included}>: {folder} may not use it" if folder in NUMERICS else None  # the system's own
    return f"<{included}>: not on the list of libraries"


def sources(root):
    tops = sorted({folder.split("/")[0] for folder in FOLDERS})
    return [path for top in tops for path in sorted((root / top).rglob("*")) if path.suffix in {".hpp", ".cpp", ".h"}]


def violations(root):
    for path in sources(root):
        name = path.relative_to(root).as_posix()
        folder = folder_of(name)
        for kind, included in INCLUDE.findall(path.read_text(encoding="utf-8")):
            problem = (check_quoted(root, folder, name, included) if kind == '"'
                       else check_angled(folder, name, included))
            if problem:
                yield f"{name}: {problem}"


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: include_order.py ROOT")
    root = Path(sys.argv[1])
    if not sources(root):
        sys.exit(f"{root}: no sources here")
    found = list(violations(root))
    print(*found, sep="\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
