//! Sequences of files, one for each frame.

use super::context::Context;
use crate::scene::file_sequence::FileSequence;
use crate::scene::json::diagnostics::MAX_REPORTED;
use crate::scene::json::key::Key;
use rayon::prelude::*;
use std::path::Path;

/// What the files of consecutive frames hold.
pub struct Samples<T> {
    /// The first frame.
    pub first: i32,
    /// At least one.
    pub samples: Vec<T>,
}

/// What `load` reads from each file of the sequence `pattern`, the value of `key`: of all frames of the bake,
/// and of those around that have files. `example` is a pattern; `rule` says what files must hold, and what to
/// do about others.
pub fn samples<T: Send>(
    context: &mut Context,
    key: &Key,
    pattern: &str,
    example: &str,
    load: impl Fn(&Path) -> Result<T, String> + Sync,
    [allowed, help]: [&str; 2],
) -> Option<Samples<T>> {
    let Some(sequence) = FileSequence::new(pattern) else {
        let message = format!("\"{pattern}\" is not a numbered file name");
        let allowed = "a file name with one run of #, a # per digit of the frame number";
        context.diagnostics.add(key, message, allowed, format!("use a name such as \"{example}\""));
        return None;
    };
    let (first, last) = sequence.available_frames(&context.folder, context.frames, context.lead);
    let absent = |frame: &i32| !sequence.path(&context.folder, *frame).is_file();
    // The range may be wrong by billions of frames: stop at the first few that are missing.
    let missing: Vec<i32> = (first..=last).filter(absent).take(MAX_REPORTED + 1).collect();
    if !missing.is_empty() {
        let message = format!("\"{pattern}\" has no file for {}", frames_in_words(&missing));
        let (first, last) = context.frames;
        let allowed = format!("a file for every frame from {first} to {last}");
        let help = "export the missing frames, or shorten \"frames\"";
        context.diagnostics.add(key, message, allowed, help);
        return None;
    }
    let frames: Vec<i32> = (first..=last).collect();
    let folder = &context.folder;
    let loaded: Vec<(i32, Result<T, String>)> =
        frames.into_par_iter().map(|frame| (frame, load(&sequence.path(folder, frame)))).collect();
    let bad: Vec<(i32, &String)> =
        loaded.iter().filter_map(|(frame, s)| Some((*frame, s.as_ref().err()?))).collect();
    for (frame, what) in bad.iter().take(MAX_REPORTED) {
        let file = sequence.path(Path::new(""), *frame);
        context.diagnostics.add(key, format!("\"{}\" {what}", file.display()), allowed, help);
    }
    if bad.len() > MAX_REPORTED {
        let message = format!("{} files of the sequence are invalid", bad.len());
        context.diagnostics.add(key, message, allowed, "export the sequence again");
    }
    let samples: Vec<T> = loaded.into_iter().map(|(_, sample)| sample.ok()).collect::<Option<_>>()?;
    (!samples.is_empty()).then_some(Samples { first, samples })
}

/// "frame 3", "frames 3, 4 and 9"; if there are more than can be listed, "frame 3 and 8 or more others".
fn frames_in_words(frames: &[i32]) -> String {
    match frames {
        [one] => format!("frame {one}"),
        [others @ .., last] if others.len() < MAX_REPORTED => {
            let others: Vec<String> = others.iter().map(i32::to_string).collect();
            format!("frames {} and {last}", others.join(", "))
        }
        _ => format!("frame {} and {MAX_REPORTED} or more others", frames[0]),
    }
}
