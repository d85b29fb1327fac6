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

