# Completion of diracstep in bash. It asks the command itself, so it knows every verb, option, scene and plugin.
_diracstep() {
  local cur="${COMP_WORDS[COMP_CWORD]}" prev="${COMP_WORDS[COMP_CWORD - 1]}" verb="" word words=""
  if declare -F _get_comp_words_by_ref >/dev/null; then
    _get_comp_words_by_ref -n : cur prev # bash takes a colon for the end of a word: type1/gl:3
  fi
  for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
    case "$word" in -*) ;; *) verb="$word" && break ;; esac
  done
  COMPREPLY=()
  case "$prev" in
    --method | --methods) words="$(diracstep list methods 2>/dev/null | awk '/^$/ { exit } NR > 1 && /^[^ ]/ { print $1 }')" ;;
    --momentum) words="plus minus projected" ;;
    --jacobian) words="automatic fresh per-step kept" ;;
    --solver) words="newton fixed-point automatic direct" ;;
    --out | --guess | --residuals | --plugin | --checkpoint | --resume | --compare) compopt -o default 2>/dev/null && return ;;
    *)
      case "$cur,$verb" in
        -*,*) words="$(diracstep ${verb:+"$verb"} --help 2>/dev/null | grep -o -e '--[a-z][a-z-]*' | sort -u)" ;;
        *,) words="$(diracstep --help 2>/dev/null | sed -n '/^Subcommands:/,/^$/s/^  \([a-z]\{1,\}\) .*/\1/p')" ;;
        *,list) words="scenes methods plugins" ;;
        *,sweep) compopt -o default 2>/dev/null && return ;;
        *,boundary | *,check | *,control | *,equilibrium | *,expand | *,fit | *,plan | *,run | *,start | *,study)
          compopt -o default 2>/dev/null # and scene files
          words="$(diracstep list scenes 2>/dev/null | awk '/^$/ { exit } NR > 1 && /^[^ ]/ { print $1 }')"
          ;;
      esac
      ;;
  esac
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$cur")
  if declare -F __ltrim_colon_completions >/dev/null; then __ltrim_colon_completions "$cur"; fi
}
complete -F _diracstep diracstep
