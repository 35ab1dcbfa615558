#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The core has no socket, file, DDS, log or clock of its own, and no room climbs over its wall with "../".
source "$(dirname "$0")/sources.sh"
if grep -nE 'sys/|\bdds|yaml|systemd|iostream|_clock::now' $(cpp_sources core) ||
   grep -nE '#include *"\.\./' $(cpp_sources); then
  echo "The lines above break a rule of the house."
  exit 1
fi
