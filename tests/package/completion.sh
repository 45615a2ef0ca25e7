#!/bin/bash
# completion.sh PREFIX: what bash proposes after some beginnings, as installed in PREFIX; every verb has its page.
set -u
PATH="$1/bin:$PATH"
# shellcheck disable=SC1090
source "$1/share/bash-completion/completions/diracstep"
failed=0

expect() { # PROPOSAL WORDS...: PROPOSAL is among what completes the last of WORDS
  local proposal="$1"
  shift
  COMP_WORDS=("$@")
  COMP_CWORD=$(($# - 1))
  _diracstep
  if ! printf '%s\n' "${COMPREPLY[@]}" | grep -qxF -e "$proposal"; then
    echo "'$*' should offer '$proposal'; offered: ${COMPREPLY[*]}"
    failed=1
  fi
}

expect study diracstep s
expect knife_edge diracstep run kni
expect --checkpoint diracstep run knife_edge --che
expect type1/midpoint diracstep run knife_edge --method type1/mid
expect projected diracstep run knife_edge --momentum p
expect methods diracstep list m
COMP_WORDS=(diracstep run no_such_scene) COMP_CWORD=2
_diracstep
[ ${#COMPREPLY[@]} -eq 0 ] || { echo "'no_such_scene' should offer nothing; offered: ${COMPREPLY[*]}"; failed=1; }

if [ -d "$1/share/man/man1" ]; then
  for verb in $(diracstep --help | sed -n '/^Subcommands:/,/^$/s/^  \([a-z]\{1,\}\) .*/\1/p'); do
    zcat "$1/share/man/man1/diracstep-$verb.1.gz" | grep -q -F -e '\-\-help' || failed=1
  done
fi
exit $failed
