#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Comments begin with a noun or a verb; comments and names of tests use the standard terms of docs/glossary.md.
source "$(dirname "$0")/sources.sh"
beginnings='^[[:space:]]*(//+<?|#) *(What|Who|Which|Of|Nobody|Whoever|That which|None)[[:space:]]'
words='(//|#).*(otherwise than thought|at its word|begins? anew|whoever |is told|are told|told by|hears of|askew)'
names='^TEST(_F|_P)?\(.*(Told|Tells|Said[A-Z)]|Says[A-Z]|Heard|Nobody[A-Z]|Whoever|Anew|Askew|Unsaid|GoesOn|GoOn|TakenFor|IsNone|AreNone)'
found=$(find "${rooms[@]}" \( -name '*.[ch]pp' -o -name '*.sh' -o -name 'CMakeLists.txt' -o -name '*.yaml' \) -print0 |
  xargs -0 grep -nE -e "$beginnings" -e "$words" -e "$names" | grep -v '/comment_words.sh:') || exit 0
echo "$found"
echo "reword these comments and names: begin comments with a noun or a verb in the present tense, and use the field's terms"
exit 1
