# SPDX-License-Identifier: Apache-2.0
# Completion of locusd, locusctl and the locus-* programs: what there is to choose is asked of their own --help.
_locus() {
  local cur prev words cword split help command
  _init_completion -s || return
  if [[ $prev == --instance ]]; then
    COMPREPLY=($(cd /run && compgen -G 'locusd@*' | sed 's/^locusd@//' | grep -F -e "$cur"))
    return
  fi
  help=$("$1" --help 2>/dev/null)
  local commands=$(sed -n '/^Subcommands:/,/^$/ s/^  \([a-z-]\+\) .*/\1/p' <<<"$help")
  for command in "${words[@]:1:cword-1}"; do
    if [[ $command != -* && " "${commands//$'\n'/ }" " == *" $command "* ]]; then
      help=$("$1" "$command" --help 2>/dev/null)$'\n'$(grep -e --instance -e --socket <<<"$help")
      commands=
      break
    fi
  done
  local choices
  if [[ $prev == --* ]]; then
    choices=$(sed -n "s/^ *\(-.,\)\?$prev [^ ]*:{\([^}]*\)}.*/\2/p" <<<"$help")
  fi
  if [[ $choices ]]; then
    COMPREPLY=($(compgen -W "${choices//,/ }" -- "$cur"))
  elif [[ $cur == -* ]]; then
    COMPREPLY=($(compgen -W "$(grep -oP '^  (-.,)?\K--[a-z-]+|^  \K-.(?=,)' <<<"$help")" -- "$cur"))
  elif [[ $commands ]]; then
    COMPREPLY=($(compgen -W "$commands" -- "$cur"))
  elif choices=$(grep -oP '^  [A-Z]+ TEXT:\{\K[^}]*' <<<"$help"); then
    COMPREPLY=($(compgen -W "${choices//,/ }" -- "$cur"))
  else
    _filedir
  fi
} &&
  complete -F _locus locusd locusctl locus-demo locus-experiments locus-play locus-replay locus-sim
