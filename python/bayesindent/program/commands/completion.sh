# For zsh, too, which has this builtin of bash.
[ -n "${ZSH_VERSION-}" ] && autoload -U +X bashcompinit compinit && compinit && bashcompinit
_bayesindent() {
  local options
  case ${COMP_CWORD}:${COMP_WORDS[1]}:${COMP_WORDS[COMP_CWORD]} in
  1:*) options='@COMMANDS@' ;;
@CASES@
  esac
  COMPREPLY=($(compgen -W "$options" -- "${COMP_WORDS[COMP_CWORD]}"))
}
complete -o default -F _bayesindent bayesindent ./bayesindent
