//! Places in a JSON file.

use std::fmt;

/// One step of a [`Key`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Step {
    /// A property of an object.
    Name(String),
    /// An element of an array.
    Index(usize),
}

/// A place in a JSON file: the steps from its root to a value. Displayed as `bodies[0].track.rest`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Key(pub Vec<Step>);

impl Key {
    /// The place of a path of property names joined by dots.
    pub fn at(path: &str) -> Self {
        Key(path.split('.').map(|name| Step::Name(name.into())).collect())
    }

    /// The place that is displayed as `text`; `None` if none is.
    pub fn parse(text: &str) -> Option<Self> {
        let mut key = Key::default();
        for part in text.split('.') {
            let mut indices = part.split('[');
            let name = indices.next().filter(|name| !name.is_empty())?;
            key.0.push(Step::Name(name.into()));
            for index in indices {
                key.0.push(Step::Index(index.strip_suffix(']')?.parse().ok()?));
            }
        }
        Some(key)
    }

    /// The property `name` of this place.
    pub fn name(&self, name: &str) -> Self {
        self.with(Step::Name(name.into()))
    }

    /// Element `i` of this place.
    pub fn index(&self, i: usize) -> Self {
        self.with(Step::Index(i))
    }

    fn with(&self, step: Step) -> Self {
        let mut key = self.clone();
        key.0.push(step);
        key
    }

    /// The property of the root that holds this place; empty for the root itself.
    pub fn section(&self) -> &str {
        match self.0.first() {
            Some(Step::Name(name)) => name,
            _ => "",
        }
    }

    /// The unit that the innermost property name ends in, such as m for `radius_m`; `None` if it names no
    /// unit.
    pub fn unit(&self) -> Option<&'static str> {
        let name = self.0.iter().rev().find_map(|step| match step {
            Step::Name(name) => Some(name),
            Step::Index(_) => None,
        })?;
        UNITS.iter().find(|(suffix, _)| name.ends_with(suffix)).map(|(_, unit)| *unit)
    }
}

/// Endings of property names and the units they mean; an ending stands before the endings that it contains.
const UNITS: &[(&str, &str)] = &[
    ("_kg_m3", "kg/m³"),
    ("_m_s2", "m/s²"),
    ("_m_s", "m/s"),
    ("_n_m", "N/m"),
    ("_per_m", "1/m"),
    ("_per_s", "1/s"),
    ("_pa", "Pa"),
    ("_hz", "Hz"),
    ("_m", "m"),
    ("_s", "s"),
];

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, step) in self.0.iter().enumerate() {
            match step {
                Step::Name(name) if i == 0 => write!(f, "{name}")?,
                Step::Name(name) => write!(f, ".{name}")?,
                Step::Index(i) => write!(f, "[{i}]")?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_follows_from_the_end_of_the_name() {
        let unit = |path: &str| Key::at(path).index(1).unit();
        assert_eq!(unit("materials.cohesion_n_m"), Some("N/m"));
        assert_eq!(unit("gravity_m_s2"), Some("m/s²"));
        assert_eq!(unit("colliders.thickness_m"), Some("m"));
        assert_eq!(unit("materials.wisp_friction_per_s"), Some("1/s"));
        assert_eq!(unit("metres_per_unit"), None);
        assert_eq!(Key::default().unit(), None);
    }
}
