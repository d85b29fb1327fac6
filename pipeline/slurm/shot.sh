#!/usr/bin/env bash
# Submits a bake to Slurm: bash THIS [OPTION OF SBATCH]... The cluster needs RequeueExit=75,85 (docs/farm.md).
set -euo pipefail

# submit NAME NEEDED COMMANDS OPTION...: submits an array with one task per line of COMMANDS, to run after the tasks NEEDED.
# Prints the ids of the tasks, joined by colons: an array with a requeued task never counts as done, but its tasks do.
submit() {
    local name=$1 needed=$2 commands=$3 count id
    shift 3
    count=$(wc -l <<<"$commands")
    id=$(sbatch --parsable --job-name="$name" --requeue --open-mode=append --signal=B:USR1@60 --array="1-$count" \
        ${needed:+--dependency="afterok:$needed" --kill-on-invalid-dep=yes} "$@" <<EOF
#!/bin/sh
command=\$(sed -n "\${SLURM_ARRAY_TASK_ID}p" <<'LINES'
$commands
LINES
)
trap 'kill -USR1 \$task' USR1
trap 'kill -TERM \$task' TERM
# Slurm does not requeue a killed process (out of memory). Start it again; it resumes from its last checkpoint.
for attempt in 1 2 3; do
    eval "\$command &"
    task=\$!
    # wait also returns when a signal arrives, before the task ends.
    while wait \$task; code=\$?; kill -0 \$task 2>/dev/null; do :; done
    [ \$code -eq 137 ] || break
    echo "killed in attempt \$attempt of 3" >&2
done
exit \$code
EOF
    )
    seq -s: -f "${id%%;*}_%g" 1 "$count"
}

step0=$(submit 'shake: simulate 1' "" 'hairbake simulate /show/shot/groom.json /show/shot/shake.json -o /show/shot/cache --shot=1001-1048 --frames=1000-1023' --cpus-per-task=8 "$@")
step1=$(submit 'shake: interpolate 1' "$step0" 'hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/cache --shot=1001-1048 --frames=1000-1007
hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/cache --shot=1001-1048 --frames=1008-1015
hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/cache --shot=1001-1048 --frames=1016-1020' --cpus-per-task=8 "$@")
step2=$(submit 'shake: simulate 2' "$step0" 'hairbake simulate /show/shot/groom.json /show/shot/shake.json -o /show/shot/cache --shot=1001-1048 --frames=1024-1047' --cpus-per-task=8 "$@")
step3=$(submit 'shake: interpolate 2' "$step2" 'hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/cache --shot=1001-1048 --frames=1021-1028
hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/cache --shot=1001-1048 --frames=1029-1036
hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/cache --shot=1001-1048 --frames=1037-1044' --cpus-per-task=8 "$@")
step4=$(submit 'shake: simulate 3' "$step2" 'hairbake simulate /show/shot/groom.json /show/shot/shake.json -o /show/shot/cache --shot=1001-1048 --frames=1048-1052' --cpus-per-task=8 "$@")
step5=$(submit 'shake: interpolate 3' "$step4" 'hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/cache --shot=1001-1048 --frames=1045-1049' --cpus-per-task=8 "$@")
step6=$(submit 'shake: assemble' "$step1:$step3:$step5" 'hairbake assemble /show/shot/groom.json /show/shot/shake.json -o /show/shot/cache --shot=1001-1048' --cpus-per-task=8 "$@")
step7=$(submit 'shake: validate files' "$step6" 'hairbake validate /show/shot/cache --only=static' --cpus-per-task=8 "$@")
step8=$(submit 'shake: validate frames' "$step6" 'hairbake validate /show/shot/cache --only=moving --frames=1000-1023
hairbake validate /show/shot/cache --only=moving --frames=1024-1047
hairbake validate /show/shot/cache --only=moving --frames=1048-1049' --cpus-per-task=8 "$@")
echo "submitted"
