//! A plan as a shell script that submits it to Slurm.

use super::Plan;
use std::fmt::Write;

/// The script. Each task is a batch job whose process is hairbake's own, so that it gets the signals: USR1 a minute before its
/// time is up, TERM when it is preempted. It then ends with exit code 85 and is queued again, if the cluster is set up to
/// (`RequeueExit=75,85`).
pub fn script(plan: &Plan) -> String {
    let mut text = String::from(
        "#!/usr/bin/env bash\n\
         # Submits a bake to Slurm: bash THIS [OPTION OF SBATCH]... The cluster needs RequeueExit=75,85 (docs/farm.md).\n\
         set -euo pipefail\n\n\
         # submit NAME NEEDED COMMANDS OPTION...: submits one task for each line of commands; says the ids of the tasks, joined by colons.\n\
         submit() {\n    \
             local name=$1 needed=$2 commands=$3 count id ids\n    \
             shift 3\n    \
             count=$(wc -l <<<\"$commands\")\n    \
             # One job in one part is waited for by its number; parts of an array each by their own, for a part that was queued again after an\n    \
             # exit code other than 0 never counts as done for the array.\n    \
             id=$(sbatch --parsable --job-name=\"$name\" --requeue --open-mode=append --signal=B:USR1@60 --array=\"1-$count\" \\\n        \
                 ${needed:+--dependency=\"afterok:$needed\" --kill-on-invalid-dep=yes} \"$@\" <<EOF\n\
         #!/bin/sh\n\
         command=\\$(sed -n \"\\${SLURM_ARRAY_TASK_ID}p\" <<'LINES'\n\
         $commands\n\
         LINES\n\
         )\n\
         eval \"exec \\$command\"\n\
         EOF\n    \
             )\n    \
             id=${id%%;*}\n    \
             ids=$(seq -s: -f \"${id}_%g\" 1 \"$count\")\n    \
             echo \"$ids\"\n\
         }\n\n",
    );
    let threads = plan.threads.map(|n| format!(" --cpus-per-task={n}")).unwrap_or_default();
    for (i, step) in plan.steps.iter().enumerate() {
        let of = |name: &String| {
            let number = plan.steps.iter().position(|s| s.name == *name).unwrap_or_default();
            format!("$step{number}")
        };
        let needed: Vec<String> = step.needs.iter().map(of).collect();
        let commands: Vec<String> = step
            .tasks()
            .iter()
            .map(|words| words.iter().map(|w| quoted(w)).collect::<Vec<_>>().join(" "))
            .collect();
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "step{i}=$(submit {} \"{}\" {}{threads} \"$@\")",
            quoted(&format!("{}: {}", plan.name, step.name)),
            needed.join(":"),
            quoted(&commands.join("\n")),
        );
    }
    text.push_str("echo \"submitted\"\n");
    text
}

/// A word as the shell reads it back.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,@%+".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.into()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}
