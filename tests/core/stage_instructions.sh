#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# stage_instructions.sh BIN [--accept]: compares the instructions of each stage per sweep with the last accepted ones.
# Scan-to-scan runs only at the start.
here=$(dirname "$(realpath "$0")")
exec "$here/../support/instruction_counts.sh" "$(realpath "$0")" "$1" "${2:-}" sweep %-15s %9d stage_instructions \
  all decode correct filter covariance scan_to_submap map
