#!/usr/bin/env bash
# Submits a bake to Slurm: bash THIS [OPTION OF SBATCH]... The cluster needs RequeueExit=75,85 (docs/farm.md).
set -euo pipefail

# submit NAME NEEDED COMMANDS OPTION...: submits an array of one task for each line of commands, to run after the tasks NEEDED; says
# the tasks' ids, joined by colons. They are waited for one by one, as an array with a task that was queued again never counts as done.
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
# Slurm queues nothing again that is killed alone, as where memory runs out. It goes on from its last checkpoint.
for attempt in 1 2 3; do
    eval "\$command &"
    task=\$!
    # A signal that is passed on ends the waiting, but not yet the task.
    while wait \$task; code=\$?; kill -0 \$task 2>/dev/null; do :; done
    [ \$code -eq 137 ] || break
    echo "killed in attempt \$attempt of 3" >&2
done
exit \$code
EOF
    )
    seq -s: -f "${id%%;*}_%g" 1 "$count"
}

