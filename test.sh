#!/bin/bash
# Builds Combforce on Debian 12 (installing what is missing, as root or with sudo) and runs the fast tests. What ctest
# says comes last, and its exit status is this script's.
set -euo pipefail
cd "$(dirname "$0")"

.ci/install
cmake --preset release
cmake --build --preset release
exec ctest --preset release -j "$(nproc)"
