//! A plan as a job template of Open Job Description 2023-09, with the extension TASK_CHUNKING.

use super::plan::{FRAMES, PATH_MAP, Plan, Step};
use crate::{Error, Result};
use serde_json::{Value, json};

/// Time between the request to stop and the kill, s. A checkpoint takes about one second.
const NOTICE: u32 = 60;

/// The template. Paths that start with the value of one of `parameters` (name, value) refer to that job
/// parameter, which the scheduler maps to its path on the worker.
///
/// # Errors
/// [`Error::Usage`] for a value with `{{`, which starts a variable of the template.
pub fn template(plan: &Plan, parameters: &[(&str, String)]) -> Result<Value> {
    let mut definitions = Vec::new();
    for (name, value) in parameters {
        check_plain(value)?;
        // The default of a path may not be absolute; it is given when the job is submitted.
        definitions.push(json!({ "name": name, "type": "PATH", "dataFlow": "NONE" }));
    }
    let steps: Vec<Value> = plan.steps.iter().map(|s| step(plan, s, parameters)).collect::<Result<_>>()?;
    Ok(json!({
        "specificationVersion": "jobtemplate-2023-09",
        "extensions": ["TASK_CHUNKING"],
        "name": plan.name,
        "parameterDefinitions": definitions,
        "jobEnvironments": [{ "name": "hairbake", "variables": { "HAIRBAKE_PROGRESS": "openjd" } }],
        "steps": steps,
    }))
}

fn step(plan: &Plan, step: &Step, parameters: &[(&str, String)]) -> Result<Value> {
    let word = |word: &String| {
        check_plain(word)?;
        let below = |(name, value): &(&str, String)| {
            let rest =
                word.strip_prefix(value.as_str()).filter(|rest| rest.is_empty() || rest.starts_with('/'))?;
            Some(format!("{{{{Param.{name}}}}}{rest}"))
        };
        let parameter = parameters.iter().find_map(below);
        Ok(parameter.unwrap_or_else(|| {
            word.replace(FRAMES, "{{Task.Param.Frames}}")
                .replace(PATH_MAP, "{{Session.PathMappingRulesFile}}")
        }))
    };
    let words: Vec<String> = step.command.iter().map(word).collect::<Result<_>>()?;
    let (command, arguments) = words.split_first().ok_or_else(|| Error::Internal("empty command".into()))?;
    let mut value = json!({
        "name": step.name,
        "script": { "actions": { "onRun": {
            "command": command,
            "args": arguments,
            "cancelation": { "mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": NOTICE },
        } } },
    });
    if let (Some((first, end)), Some((_, last))) = (step.chunks.first(), step.chunks.last()) {
        value["parameterSpace"] = json!({ "taskParameterDefinitions": [{
            "name": "Frames",
            "type": "CHUNK[INT]",
            "range": format!("{first}-{last}"),
            "chunks": { "defaultTaskCount": i64::from(*end) - i64::from(*first) + 1, "rangeConstraint": "CONTIGUOUS" },
        }] });
    }
    if !step.needs.is_empty() {
        value["dependencies"] = step.needs.iter().map(|name| json!({ "dependsOn": name })).collect();
    }
    if let Some(threads) = plan.threads {
        value["hostRequirements"] = json!({ "amounts": [{ "name": "amount.worker.vcpu", "min": threads }] });
    }
    Ok(value)
}

fn check_plain(text: &str) -> Result<()> {
    if text.contains("{{") {
        return Err(Error::Usage(format!("\"{text}\" contains {{{{, which starts a variable in OpenJD")));
    }
    Ok(())
}
