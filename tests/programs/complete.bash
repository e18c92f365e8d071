# What bash offers for the last word of a line:
# bash --norc complete.bash SCRIPT WORD ..., with the completion script that the program prints.

. "$1"
shift

COMP_WORDS=("$@")
COMP_CWORD=$(($# - 1))
COMP_LINE="$*"
COMP_POINT=${#COMP_LINE}

# the script says itself which function completes the program's name
set -- $(complete -p ripple-sim)
while [ "$1" != -F ]; do shift; done
function=$2

"$function" ripple-sim "${COMP_WORDS[$COMP_CWORD]}" "${COMP_WORDS[$((COMP_CWORD - 1))]}"
printf '%s\n' "${COMPREPLY[@]}"
