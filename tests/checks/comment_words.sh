#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Comments begin with a noun or a verb, and use the standard terms of docs/glossary.md.
source "$(dirname "$0")/sources.sh"
beginnings='^[[:space:]]*(//+<?|#) *(What|Who|Which|Of|Nobody|Whoever|That which|None)[[:space:]]'
words='(//|#).*(otherwise than thought|at its word|begins? anew|whoever |is told|are told|told by|hears of|askew)'
found=$(find "${rooms[@]}" \( -name '*.[ch]pp' -o -name '*.sh' -o -name 'CMakeLists.txt' -o -name '*.yaml' \) -print0 |
  xargs -0 grep -nE -e "$beginnings" -e "$words" | grep -v '/comment_words.sh:') || exit 0
echo "$found"
echo "reword these comments: begin with a noun or a verb in the present tense, and use the field's terms"
exit 1
