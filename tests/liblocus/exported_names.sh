#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# exported_names.sh LIBRARY: the library exports exactly the declarations of liblocus.hpp, so that it cannot collide
# with names of a program.
set -euo pipefail
names=$(nm -D --defined-only -C "$1" | cut -d ' ' -f 3- | sed 's/@@LIBLOCUS_0$//')
grep -q '^liblocus::Odometry::packet' <<<"$names" || { echo "liblocus::Odometry::packet is not exported"; exit 1; }
others=$(grep -vE '^(liblocus::|(vtable|typeinfo( name)?) for liblocus::Error$|LIBLOCUS_0$)' <<<"$names" || true
         grep -E 'Implementation|(^|[^b])locus::' <<<"$names" || true)
[ -z "$others" ] || { echo "names that are not the library's are exported:"; echo "$others"; exit 1; }
