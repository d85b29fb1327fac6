//! Names that are not yet taken.

use std::collections::BTreeSet;

/// Names that are taken.
#[derive(Clone, Default)]
pub(super) struct Names(BTreeSet<String>);

impl Names {
    /// Takes `name`, with a number appended if it is taken already.
    pub(super) fn unique(&mut self, name: &str) -> String {
        let mut unique = name.to_string();
        for i in 2.. {
            if self.0.insert(unique.clone()) {
                break;
            }
            unique = format!("{name}_{i}");
        }
        unique
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_names_are_numbered() {
        let mut names = Names::default();
        assert_eq!(["a", "a", "a", "b"].map(|name| names.unique(name)), ["a", "a_2", "a_3", "b"]);
    }
}
