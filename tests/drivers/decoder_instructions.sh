#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# decoder_instructions.sh BIN [--accept]: compares the instructions of each decoder per return with the last accepted
# ones.
here=$(dirname "$(realpath "$0")")
exec "$here/../support/instruction_counts.sh" "$(realpath "$0")" "$1" "${2:-}" return %-36s %6.1f decoder_instructions
