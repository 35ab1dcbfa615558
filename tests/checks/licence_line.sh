#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Every hand-written file begins with the licence line (after #! if there is one).
source "$(dirname "$0")/sources.sh"
status=0
while read -r file; do
  if ! head -n 2 "$file" | grep -q 'SPDX-License-Identifier: Apache-2.0$'; then
    echo "$file:1: lacks the line 'SPDX-License-Identifier: Apache-2.0'"
    status=1
  fi
done < <(cpp_sources; find "${rooms[@]}" packaging systemd docs .ci CMakeLists.txt ./*.sh \
           -name CMakeLists.txt -o -name '*.cmake' -o -name '*.sh' -o -name '*.yaml' -o -name '*.conf' -o -name 'locusd.s*' -o -path .ci/run)
exit $status
