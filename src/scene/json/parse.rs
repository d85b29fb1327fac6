//! JSON text to its value. Reports keys that an object holds twice: serde_json would silently keep the last.

use super::diagnostics::MAX_REPORTED;
use super::key::{Key, Step};
use serde::Deserializer;
use serde::de::{DeserializeSeed, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};
use std::fmt;

/// The value of a JSON text, and its duplicate keys.
///
/// # Errors
/// The text is not JSON.
pub fn parse(text: &[u8]) -> serde_json::Result<(Value, Vec<Key>)> {
    let (mut key, mut duplicates) = (Key::default(), Vec::new());
    let mut deserializer = serde_json::Deserializer::from_slice(text);
    let value = ValueSeed { key: &mut key, duplicates: &mut duplicates }.deserialize(&mut deserializer)?;
    deserializer.end()?;
    Ok((value, duplicates))
}

/// Reads the value at `key`.
struct ValueSeed<'a> {
    key: &'a mut Key,
    duplicates: &'a mut Vec<Key>,
}

impl ValueSeed<'_> {
    fn reborrow(&mut self) -> ValueSeed<'_> {
        ValueSeed { key: self.key, duplicates: self.duplicates }
    }
}

impl<'de> DeserializeSeed<'de> for ValueSeed<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for ValueSeed<'_> {
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
            let element = elements.next_element_seed(self.reborrow())?;
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
            if map.contains_key(&name) && self.duplicates.len() < MAX_REPORTED {
                self.duplicates.push(self.key.clone());
            }
            let value = properties.next_value_seed(self.reborrow())?;
            self.key.0.pop();
            map.insert(name, value);
        }
        Ok(map.into())
    }
}
