# SPDX-License-Identifier: Apache-2.0
# For the checks beside it: strict shell, the project's folder, its sources.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
rooms=(core drivers config daemon tools tests)

# cpp_sources [FOLDER]...: the C++ files of the rooms given, or of all.
cpp_sources() { find "${@:-"${rooms[@]}"}" -name '*.cpp' -o -name '*.hpp' | sort; }
