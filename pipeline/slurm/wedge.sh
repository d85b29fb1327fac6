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

step0=$(submit 'shake: 001 simulate 1' "" 'hairbake simulate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/001_friction=0.1_substeps=4 --shot=1001-1024 --set '\''groom.materials[0].friction=0.1'\'' --substeps 4 --frames=1000-1028' --cpus-per-task=8 "$@")
step1=$(submit 'shake: 001 interpolate 1' "$step0" 'hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/001_friction=0.1_substeps=4 --shot=1001-1024 --set '\''groom.materials[0].friction=0.1'\'' --substeps 4 --frames=1000-1009
hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/001_friction=0.1_substeps=4 --shot=1001-1024 --set '\''groom.materials[0].friction=0.1'\'' --substeps 4 --frames=1010-1019
hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/001_friction=0.1_substeps=4 --shot=1001-1024 --set '\''groom.materials[0].friction=0.1'\'' --substeps 4 --frames=1020-1025' --cpus-per-task=8 "$@")
step2=$(submit 'shake: 001 assemble' "$step1" 'hairbake assemble /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/001_friction=0.1_substeps=4 --shot=1001-1024 --set '\''groom.materials[0].friction=0.1'\'' --substeps 4' --cpus-per-task=8 "$@")
step3=$(submit 'shake: 001 validate files' "$step2" 'hairbake validate /show/shot/wedge/001_friction=0.1_substeps=4 --only=static' --cpus-per-task=8 "$@")
step4=$(submit 'shake: 001 validate frames' "$step2" 'hairbake validate /show/shot/wedge/001_friction=0.1_substeps=4 --only=moving --frames=1000-1025' --cpus-per-task=8 "$@")
step5=$(submit 'shake: 002 simulate 1' "" 'hairbake simulate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/002_friction=0.1_substeps=8 --shot=1001-1024 --set '\''groom.materials[0].friction=0.1'\'' --substeps 8 --frames=1000-1028' --cpus-per-task=8 "$@")
step6=$(submit 'shake: 002 interpolate 1' "$step5" 'hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/002_friction=0.1_substeps=8 --shot=1001-1024 --set '\''groom.materials[0].friction=0.1'\'' --substeps 8 --frames=1000-1009
hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/002_friction=0.1_substeps=8 --shot=1001-1024 --set '\''groom.materials[0].friction=0.1'\'' --substeps 8 --frames=1010-1019
hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/002_friction=0.1_substeps=8 --shot=1001-1024 --set '\''groom.materials[0].friction=0.1'\'' --substeps 8 --frames=1020-1025' --cpus-per-task=8 "$@")
step7=$(submit 'shake: 002 assemble' "$step6" 'hairbake assemble /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/002_friction=0.1_substeps=8 --shot=1001-1024 --set '\''groom.materials[0].friction=0.1'\'' --substeps 8' --cpus-per-task=8 "$@")
step8=$(submit 'shake: 002 validate files' "$step7" 'hairbake validate /show/shot/wedge/002_friction=0.1_substeps=8 --only=static' --cpus-per-task=8 "$@")
step9=$(submit 'shake: 002 validate frames' "$step7" 'hairbake validate /show/shot/wedge/002_friction=0.1_substeps=8 --only=moving --frames=1000-1025' --cpus-per-task=8 "$@")
step10=$(submit 'shake: 003 simulate 1' "" 'hairbake simulate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/003_friction=0.3_substeps=4 --shot=1001-1024 --set '\''groom.materials[0].friction=0.3'\'' --substeps 4 --frames=1000-1028' --cpus-per-task=8 "$@")
step11=$(submit 'shake: 003 interpolate 1' "$step10" 'hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/003_friction=0.3_substeps=4 --shot=1001-1024 --set '\''groom.materials[0].friction=0.3'\'' --substeps 4 --frames=1000-1009
hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/003_friction=0.3_substeps=4 --shot=1001-1024 --set '\''groom.materials[0].friction=0.3'\'' --substeps 4 --frames=1010-1019
hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/003_friction=0.3_substeps=4 --shot=1001-1024 --set '\''groom.materials[0].friction=0.3'\'' --substeps 4 --frames=1020-1025' --cpus-per-task=8 "$@")
step12=$(submit 'shake: 003 assemble' "$step11" 'hairbake assemble /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/003_friction=0.3_substeps=4 --shot=1001-1024 --set '\''groom.materials[0].friction=0.3'\'' --substeps 4' --cpus-per-task=8 "$@")
step13=$(submit 'shake: 003 validate files' "$step12" 'hairbake validate /show/shot/wedge/003_friction=0.3_substeps=4 --only=static' --cpus-per-task=8 "$@")
step14=$(submit 'shake: 003 validate frames' "$step12" 'hairbake validate /show/shot/wedge/003_friction=0.3_substeps=4 --only=moving --frames=1000-1025' --cpus-per-task=8 "$@")
step15=$(submit 'shake: 004 simulate 1' "" 'hairbake simulate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/004_friction=0.3_substeps=8 --shot=1001-1024 --set '\''groom.materials[0].friction=0.3'\'' --substeps 8 --frames=1000-1028' --cpus-per-task=8 "$@")
step16=$(submit 'shake: 004 interpolate 1' "$step15" 'hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/004_friction=0.3_substeps=8 --shot=1001-1024 --set '\''groom.materials[0].friction=0.3'\'' --substeps 8 --frames=1000-1009
hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/004_friction=0.3_substeps=8 --shot=1001-1024 --set '\''groom.materials[0].friction=0.3'\'' --substeps 8 --frames=1010-1019
hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/004_friction=0.3_substeps=8 --shot=1001-1024 --set '\''groom.materials[0].friction=0.3'\'' --substeps 8 --frames=1020-1025' --cpus-per-task=8 "$@")
step17=$(submit 'shake: 004 assemble' "$step16" 'hairbake assemble /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/004_friction=0.3_substeps=8 --shot=1001-1024 --set '\''groom.materials[0].friction=0.3'\'' --substeps 8' --cpus-per-task=8 "$@")
step18=$(submit 'shake: 004 validate files' "$step17" 'hairbake validate /show/shot/wedge/004_friction=0.3_substeps=8 --only=static' --cpus-per-task=8 "$@")
step19=$(submit 'shake: 004 validate frames' "$step17" 'hairbake validate /show/shot/wedge/004_friction=0.3_substeps=8 --only=moving --frames=1000-1025' --cpus-per-task=8 "$@")
step20=$(submit 'shake: 005 simulate 1' "" 'hairbake simulate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/005_friction=0.5_substeps=4 --shot=1001-1024 --set '\''groom.materials[0].friction=0.5'\'' --substeps 4 --frames=1000-1028' --cpus-per-task=8 "$@")
step21=$(submit 'shake: 005 interpolate 1' "$step20" 'hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/005_friction=0.5_substeps=4 --shot=1001-1024 --set '\''groom.materials[0].friction=0.5'\'' --substeps 4 --frames=1000-1009
hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/005_friction=0.5_substeps=4 --shot=1001-1024 --set '\''groom.materials[0].friction=0.5'\'' --substeps 4 --frames=1010-1019
hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/005_friction=0.5_substeps=4 --shot=1001-1024 --set '\''groom.materials[0].friction=0.5'\'' --substeps 4 --frames=1020-1025' --cpus-per-task=8 "$@")
step22=$(submit 'shake: 005 assemble' "$step21" 'hairbake assemble /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/005_friction=0.5_substeps=4 --shot=1001-1024 --set '\''groom.materials[0].friction=0.5'\'' --substeps 4' --cpus-per-task=8 "$@")
step23=$(submit 'shake: 005 validate files' "$step22" 'hairbake validate /show/shot/wedge/005_friction=0.5_substeps=4 --only=static' --cpus-per-task=8 "$@")
step24=$(submit 'shake: 005 validate frames' "$step22" 'hairbake validate /show/shot/wedge/005_friction=0.5_substeps=4 --only=moving --frames=1000-1025' --cpus-per-task=8 "$@")
step25=$(submit 'shake: 006 simulate 1' "" 'hairbake simulate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/006_friction=0.5_substeps=8 --shot=1001-1024 --set '\''groom.materials[0].friction=0.5'\'' --substeps 8 --frames=1000-1028' --cpus-per-task=8 "$@")
step26=$(submit 'shake: 006 interpolate 1' "$step25" 'hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/006_friction=0.5_substeps=8 --shot=1001-1024 --set '\''groom.materials[0].friction=0.5'\'' --substeps 8 --frames=1000-1009
hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/006_friction=0.5_substeps=8 --shot=1001-1024 --set '\''groom.materials[0].friction=0.5'\'' --substeps 8 --frames=1010-1019
hairbake interpolate /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/006_friction=0.5_substeps=8 --shot=1001-1024 --set '\''groom.materials[0].friction=0.5'\'' --substeps 8 --frames=1020-1025' --cpus-per-task=8 "$@")
step27=$(submit 'shake: 006 assemble' "$step26" 'hairbake assemble /show/shot/groom.json /show/shot/shake.json -o /show/shot/wedge/006_friction=0.5_substeps=8 --shot=1001-1024 --set '\''groom.materials[0].friction=0.5'\'' --substeps 8' --cpus-per-task=8 "$@")
step28=$(submit 'shake: 006 validate files' "$step27" 'hairbake validate /show/shot/wedge/006_friction=0.5_substeps=8 --only=static' --cpus-per-task=8 "$@")
step29=$(submit 'shake: 006 validate frames' "$step27" 'hairbake validate /show/shot/wedge/006_friction=0.5_substeps=8 --only=moving --frames=1000-1025' --cpus-per-task=8 "$@")
step30=$(submit 'shake: sheet' "$step2:$step7:$step12:$step17:$step22:$step27" 'hairbake preview /show/shot/wedge/001_friction=0.1_substeps=4 /show/shot/wedge/002_friction=0.1_substeps=8 /show/shot/wedge/003_friction=0.3_substeps=4 /show/shot/wedge/004_friction=0.3_substeps=8 /show/shot/wedge/005_friction=0.5_substeps=4 /show/shot/wedge/006_friction=0.5_substeps=8 -o /show/shot/wedge/wedges.png' --cpus-per-task=8 "$@")
echo "submitted"
