//! JSON text to its value, with the names that stand twice in one object: of those serde_json would keep the last and
//! say nothing.

use super::{Key, MAX_NAMED, Step};
use serde::Deserializer;
use serde::de::{DeserializeSeed, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};
use std::fmt;

/// The value of a JSON text, and the keys that it gives again.
///
/// # Errors
/// Text that is not JSON.
pub fn parse(text: &[u8]) -> serde_json::Result<(Value, Vec<Key>)> {
    let (mut key, mut repeated) = (Key::default(), Vec::new());
    let mut deserializer = serde_json::Deserializer::from_slice(text);
    let value = Place { key: &mut key, repeated: &mut repeated }.deserialize(&mut deserializer)?;
    deserializer.end()?;
    Ok((value, repeated))
}

/// The place whose value comes next.
struct Place<'a> {
    key: &'a mut Key,
    repeated: &'a mut Vec<Key>,
}

impl Place<'_> {
    fn inside(&mut self) -> Place<'_> {
        Place { key: self.key, repeated: self.repeated }
    }
}

impl<'de> DeserializeSeed<'de> for Place<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Place<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E: Error>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E: Error>(self, x: bool) -> Result<Value, E> {
        Ok(x.into())
    }

    fn visit_i64<E: Error>(self, x: i64) -> Result<Value, E> {
        Ok(x.into())
    }

    fn visit_u64<E: Error>(self, x: u64) -> Result<Value, E> {
        Ok(x.into())
    }

    fn visit_f64<E: Error>(self, x: f64) -> Result<Value, E> {
        Number::from_f64(x).map(Value::Number).ok_or_else(|| E::custom("number out of range"))
    }

    fn visit_str<E: Error>(self, x: &str) -> Result<Value, E> {
        Ok(x.into())
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut elements: A) -> Result<Value, A::Error> {
        let mut list = Vec::new();
        loop {
            self.key.0.push(Step::Index(list.len()));
            let element = elements.next_element_seed(self.inside())?;
            self.key.0.pop();
            match element {
                Some(element) => list.push(element),
                None => return Ok(list.into()),
            }
        }
    }

    fn visit_map<A: MapAccess<'de>>(mut self, mut properties: A) -> Result<Value, A::Error> {
        let mut map = Map::new();
        while let Some(name) = properties.next_key::<String>()? {
            self.key.0.push(Step::Name(name.clone()));
            if map.contains_key(&name) && self.repeated.len() < MAX_NAMED {
                self.repeated.push(self.key.clone());
            }
            let value = properties.next_value_seed(self.inside())?;
            self.key.0.pop();
            map.insert(name, value);
        }
        Ok(map.into())
    }
}
