#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# lintian.sh FOLDER: Debian's own checks find nothing in the packages there, not even to remark.
set -euo pipefail
lintian --allow-root -I --pedantic --fail-on error,warning,info,pedantic "$1"/*.changes
