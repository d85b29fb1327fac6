use super::*;
use crate::Error;

fn words(text: &str) -> Vec<String> {
    text.split(' ').map(String::from).collect()
}

fn commands(name: &str) -> Commands {
    Commands {
        name: name.into(),
        simulate: words("hairbake simulate --frames {frames}"),
        interpolate: words("hairbake interpolate --frames {frames}"),
        assemble: words("hairbake assemble"),
        validate: Some(ValidateCommands {
            files: words("hairbake validate --only=static"),
            frames: words("hairbake validate --frames {frames}"),
        }),
    }
}

const DIVISION: Division =
    Division { frames: (1000, 1021), lookahead: 2, segment: 10, interpolate: 4, validate: 99 };

#[test]
fn every_frame_is_interpolated_once_after_the_frames_that_it_needs() {
    for segment in [1, 2, 3, 7, 10, 24, 99] {
        for interpolate in [1, 3, 99] {
            let mut plan = Plan::new("shot", None);
            plan.add_bake(&commands(""), Division { segment, interpolate, ..DIVISION }).unwrap();
            let mut simulated = Vec::new();
            let mut interpolated = Vec::new();
            for (i, step) in plan.steps.iter().enumerate() {
                assert!(step.needs.iter().all(|name| plan.steps[..i].iter().any(|s| s.name == *name)));
                if step.name.starts_with("simulate") {
                    let (a, b) = step.command.last().unwrap().split_once('-').unwrap();
                    let (a, b): (i32, i32) = (a.parse().unwrap(), b.parse().unwrap());
                    assert_eq!(a, simulated.last().map_or(1000, |last| last + 1));
                    simulated.extend(a..=b);
                }
                if step.name.starts_with("interpolate") {
                    let frames: Vec<i32> = step.chunks.iter().flat_map(|(a, b)| *a..=*b).collect();
                    assert!(frames.iter().all(|frame| simulated.contains(&(frame + 2))));
                    interpolated.extend(frames);
                }
            }
            assert_eq!(simulated, (1000..=1023).collect::<Vec<_>>());
            assert_eq!(interpolated, (1000..=1021).collect::<Vec<_>>());
        }
    }
}

#[test]
fn too_many_tasks_are_refused() {
    let mut plan = Plan::new("shot", None);
    let division = Division { frames: (0, 2_000_000), interpolate: 1, segment: 3_000_000, ..DIVISION };
    assert!(matches!(plan.add_bake(&commands(""), division), Err(Error::Usage(_))));
}

#[test]
fn openjd_rejects_template_variables_in_values() {
    let mut plan = Plan::new("shot", None);
    plan.add_bake(&commands(""), DIVISION).unwrap();
    let template = openjd::template(&plan, &[("Groom", "/a/{{Param.Secret}}".into())]);
    assert!(matches!(template, Err(Error::Usage(_))));
    plan.steps[0].command.push("{{x}}".into());
    assert!(matches!(openjd::template(&plan, &[]), Err(Error::Usage(_))));
}

#[test]
fn words_survive_the_shell() {
    let mut plan = Plan::new("it's; a $(shot)", Some(3));
    let command = words("printf %s| $(false) `a` it's \"b\" ; $HOME \\n & LINES EOF * {frames}");
    plan.add(Step { name: "a".into(), command, chunks: vec![(1, 2), (3, 4)], needs: Vec::new() }).unwrap();
    let script = slurm::script(&plan).unwrap();
    // Replaces sbatch: prints its options and runs the second task.
    let fake = "sbatch() { printf '%s|' \"$@\" >&2; SLURM_ARRAY_TASK_ID=2 sh >&2; echo 7; }\n";
    let ran = std::process::Command::new("bash").args(["-c", &format!("{fake}{script}")]).output().unwrap();
    let said = String::from_utf8(ran.stderr).unwrap();
    assert!(ran.status.success(), "{said}");
    assert!(said.contains("--job-name=it's; a $(shot): a|") && said.contains("--cpus-per-task=3|"), "{said}");
    assert!(said.ends_with("|$(false)|`a`|it's|\"b\"|;|$HOME|\\n|&|LINES|EOF|*|3-4|"), "{said}");
    plan.steps[0].command.push("a\nb".into());
    assert!(matches!(slurm::script(&plan), Err(Error::Usage(_))));
}
