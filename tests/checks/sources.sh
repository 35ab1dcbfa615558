# SPDX-License-Identifier: Apache-2.0
# Sourced by the other checks: strict shell, project folder, list of sources.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
rooms=(core drivers config daemon tools tests)

# cpp_sources [FOLDER]...: prints the C++ files of the given rooms, or of all.
cpp_sources() { find "${@:-"${rooms[@]}"}" -name '*.cpp' -o -name '*.hpp' | sort; }
