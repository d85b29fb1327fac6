//! Wedges: sweeps of a bake over the values of settings.

use crate::error::{Error, Result};
use std::path::Path;

/// Most combinations of a sweep.
const MAX_COMBINATIONS: usize = 1000;

/// A setting and the values that it takes.
pub type Wedge = (String, Vec<String>);

/// Parses a wedge: `NAME=V1,V2`. Commas in brackets belong to a value.
pub fn wedge(text: &str) -> std::result::Result<Wedge, String> {
    let help = || "expected NAME=V1,V2, such as substeps=4,8".to_string();
    let (name, list) = text.split_once('=').ok_or_else(help)?;
    let mut values = vec![String::new()];
    let mut depth = 0;
    for c in list.chars() {
        match c {
            '[' | '{' => depth += 1,
            ']' | '}' => depth -= 1,
            _ => {}
        }
        if c == ',' && depth == 0 {
            values.push(String::new());
        } else if let Some(value) = values.last_mut() {
            value.push(c);
        }
    }
    if name.is_empty() || values.iter().any(String::is_empty) {
        return Err(help());
    }
    Ok((name.into(), values))
}

/// Every combination of the values of the wedges, as pairs of name and value.
///
/// # Errors
/// [`Error::Usage`] for too many combinations.
pub fn combinations(wedges: &[Wedge]) -> Result<Vec<Vec<(String, String)>>> {
    let count = wedges.iter().try_fold(1usize, |n, (_, values)| n.checked_mul(values.len()));
    if count.is_none_or(|n| n > MAX_COMBINATIONS) {
        return Err(Error::Usage(format!("more than {MAX_COMBINATIONS} combinations of wedges")));
    }
    let mut all = vec![Vec::new()];
    for (name, values) in wedges {
        let with = |chosen: &Vec<(String, String)>, value: &String| {
            [chosen.clone(), vec![(name.clone(), value.clone())]].concat()
        };
        all = all.iter().flat_map(|chosen| values.iter().map(move |value| with(chosen, value))).collect();
    }
    Ok(all)
}

/// The folder of a combination below `out`: its number and values, in characters that every file system
/// accepts.
pub fn folder(out: &str, number: &str, values: &[(String, String)]) -> String {
    let words: Vec<String> = values
        .iter()
        .map(|(name, value)| format!("{}={value}", name.rsplit('.').next().unwrap_or(name)))
        .collect();
    let plain = |c: char| if c.is_ascii_alphanumeric() || "=.-".contains(c) { c } else { '_' };
    let name: String = words.join("_").chars().map(plain).take(100).collect();
    Path::new(out).join(format!("{number}_{name}")).display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_may_be_lists() {
        let parsed = wedge("anim.gravity_m_s2=[0,-1,0],[0,-9.8,0]").unwrap();
        assert_eq!(parsed, ("anim.gravity_m_s2".into(), vec!["[0,-1,0]".into(), "[0,-9.8,0]".into()]));
        for wrong in ["", "substeps", "=1", "substeps=", "substeps=1,,2"] {
            assert!(wedge(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn combinations_are_limited() {
        let values: Vec<String> = (0..40).map(|n| n.to_string()).collect();
        let wedges = [("a".into(), values.clone()), ("b".into(), values)];
        assert_eq!(combinations(&wedges[..1]).unwrap().len(), 40);
        assert!(combinations(&wedges).is_err());
    }
}
