#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The core uses no socket, file, DDS, log or clock, and no room includes another by "../".
source "$(dirname "$0")/sources.sh"
if grep -nE 'sys/|\bdds|yaml|systemd|iostream|_clock::now' $(cpp_sources core) ||
   grep -nE '#include *"\.\./' $(cpp_sources); then
  echo "The lines above break a rule of the house."
  exit 1
fi
