//! One walk through a document of JSON.

use super::super::cell::Cell;
use super::super::error::{ReadError, at_pointer, malformed};
use super::super::json;
use super::super::memory::Memory;
use greybox_numerics::parsing::Fault;
use serde::de::{self, DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};
use std::fmt;
use std::io::Read;
use std::rc::Rc;

/// Memory that a value takes in a list that grows by doubling, and a field with its key `[bytes]`.
const VALUE_BYTES: u64 = 2 * size_of::<JsonLeaf>() as u64;
const FIELD_BYTES: u64 = 2 * size_of::<(Rc<str>, JsonLeaf)>() as u64;

/// Different keys that are kept for the next object.
const KEPT_KEYS: usize = 64;

/// A value of the document, without what was handed over already.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum JsonLeaf {
    Null,
    Bool(bool),
    Integer(i64),
    Number(f64),
    Text(String),
    List(Vec<JsonLeaf>),
    Object(Fields),
    /// It was handed over.
    Taken,
}

/// The fields of an object.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Fields(pub(super) Vec<(Rc<str>, JsonLeaf)>);

/// Where an object stands: the objects around it, from the outermost, as far as they were read.
pub(super) struct Surroundings<'w> {
    pub(super) objects: &'w [Fields],
    path: &'w [PathStep],
}

#[derive(Clone, Debug)]
enum PathStep {
    Key(Rc<str>),
    Index(usize),
}

/// Who is handed what is met.
pub(super) trait Visit {
    /// An object that is complete. Answers whether it took it.
    fn object(&mut self, around: &Surroundings<'_>, fields: &Fields) -> bool;

    /// An array of scalars within an array.
    fn row(&mut self, around: &Surroundings<'_>, cells: &[JsonLeaf]);

    /// Whether reading on is pointless.
    fn is_full(&self) -> bool;
}

/// Walks through the document. Values that wait for the end of their list or object take memory.
pub(super) fn walk(
    source: impl Read,
    memory: &Memory,
    visit: &mut impl Visit,
) -> Result<(), ReadError> {
    let mut walker = Walker {
        memory: memory.clone(),
        held: 0,
        refusal: None,
        visit,
        objects: Vec::new(),
        path: Vec::new(),
        keys: Vec::new(),
    };
    let walked = through(source, &mut walker);
    memory.release(walker.held);
    match walker.refusal {
        Some(detail) => Err(malformed(Fault::of_whole("too_much_memory", detail))),
        None => walked.map_err(json::from_json),
    }
}

fn through<V: Visit>(
    source: impl Read,
    walker: &mut Walker<'_, V>,
) -> Result<(), serde_json::Error> {
    let mut text = serde_json::Deserializer::from_reader(source);
    for document in 1.. {
        let node = LeafSeed {
            walker: &mut *walker,
            in_list: false,
        };
        let leaf = node.deserialize(&mut text)?;
        // Objects on lines of their own are documents that follow each other.
        match text.end() {
            Err(error) if !walker.visit.is_full() => {
                let is_scalar = !matches!(
                    leaf,
                    JsonLeaf::Taken | JsonLeaf::Object(_) | JsonLeaf::List(_)
                );
                if error.is_io() || is_scalar {
                    return Err(error);
                }
            }
            _ => break,
        }
        walker.path = vec![PathStep::Index(document)];
    }
    Ok(())
}

struct Walker<'v, V> {
    memory: Memory,
    /// Bytes of the values that wait.
    held: u64,
    /// Why the values that wait are too many, where they are.
    refusal: Option<String>,
    visit: &'v mut V,
    objects: Vec<Fields>,
    path: Vec<PathStep>,
    keys: Vec<Rc<str>>,
}

impl<V> Walker<'_, V> {
    /// Holds a value until its list or object ends.
    fn hold<E: de::Error>(&mut self, leaf: &JsonLeaf, bytes: u64) -> Result<(), E> {
        let bytes = match leaf {
            JsonLeaf::Text(text) => bytes + text.len() as u64,
            _ => bytes,
        };
        self.memory.take(bytes);
        self.held += bytes;
        if self.memory.left() > 0 {
            return Ok(());
        }
        let detail = format!(
            "values beside the samples take {} MiB of memory, which is all that a body of this size \
             leaves for them; send the samples alone",
            self.held >> 20
        );
        self.refusal = Some(detail.clone());
        Err(E::custom(detail))
    }

    /// Lets go of what came since so much was held.
    fn let_go(&mut self, held: u64) {
        self.memory.release(self.held - held);
        self.held = held;
    }

    fn key(&mut self, key: &str) -> Rc<str> {
        if let Some(kept) = self.keys.iter().find(|kept| &***kept == key) {
            return Rc::clone(kept);
        }
        let new: Rc<str> = key.into();
        if self.keys.len() < KEPT_KEYS {
            self.keys.push(Rc::clone(&new));
        }
        new
    }
}

/// A place of the document.
struct LeafSeed<'n, 'v, V> {
    walker: &'n mut Walker<'v, V>,
    in_list: bool,
}

impl<'de, V: Visit> DeserializeSeed<'de> for LeafSeed<'_, '_, V> {
    type Value = JsonLeaf;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<JsonLeaf, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de, V: Visit> Visitor<'de> for LeafSeed<'_, '_, V> {
    type Value = JsonLeaf;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("any value")
    }

    fn visit_unit<E>(self) -> Result<JsonLeaf, E> {
        Ok(JsonLeaf::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<JsonLeaf, E> {
        Ok(JsonLeaf::Bool(value))
    }

    fn visit_f64<E>(self, value: f64) -> Result<JsonLeaf, E> {
        Ok(JsonLeaf::Number(value))
    }

    fn visit_u64<E>(self, value: u64) -> Result<JsonLeaf, E> {
        Ok(i64::try_from(value).map_or(JsonLeaf::Number(value as f64), JsonLeaf::Integer))
    }

    fn visit_i64<E>(self, value: i64) -> Result<JsonLeaf, E> {
        Ok(JsonLeaf::Integer(value))
    }

    fn visit_str<E>(self, text: &str) -> Result<JsonLeaf, E> {
        Ok(JsonLeaf::Text(text.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<JsonLeaf, A::Error> {
        let walker = self.walker;
        let mut scalars = Vec::new();
        let mut all_scalars = true;
        let held = walker.held;
        for index in 0.. {
            walker.path.push(PathStep::Index(index));
            let node = LeafSeed {
                walker: &mut *walker,
                in_list: true,
            };
            let element = seq.next_element_seed(node)?;
            walker.path.pop();
            match element {
                None => break,
                Some(JsonLeaf::List(_) | JsonLeaf::Object(_) | JsonLeaf::Taken) => {
                    all_scalars = false
                }
                Some(scalar) => {
                    walker.hold(&scalar, VALUE_BYTES)?;
                    scalars.push(scalar);
                }
            }
        }
        if self.in_list && all_scalars {
            let around = Surroundings {
                objects: &walker.objects,
                path: &walker.path,
            };
            walker.visit.row(&around, &scalars);
            walker.let_go(held);
            return Ok(JsonLeaf::Taken);
        }
        if all_scalars {
            return Ok(JsonLeaf::List(scalars));
        }
        walker.let_go(held);
        Ok(JsonLeaf::Taken)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<JsonLeaf, A::Error> {
        let walker = self.walker;
        walker.objects.push(Fields::default());
        let held = walker.held;
        while let Some(key) = map.next_key_seed(KeySeed(walker))? {
            walker.path.push(PathStep::Key(Rc::clone(&key)));
            let node = LeafSeed {
                walker: &mut *walker,
                in_list: false,
            };
            let value = map.next_value_seed(node)?;
            walker.path.pop();
            walker.hold(&value, FIELD_BYTES)?;
            let fields = walker.objects.last_mut().expect("this object's fields");
            fields.0.push((key, value));
        }
        let fields = walker.objects.pop().expect("this object's fields");
        let around = Surroundings {
            objects: &walker.objects,
            path: &walker.path,
        };
        let is_taken = walker.visit.is_full() || walker.visit.object(&around, &fields);
        if is_taken {
            walker.let_go(held);
            return Ok(JsonLeaf::Taken);
        }
        Ok(JsonLeaf::Object(fields))
    }
}

/// A key, of which the same text is kept once.
struct KeySeed<'n, 'v, V>(&'n mut Walker<'v, V>);

impl<'de, V> DeserializeSeed<'de> for KeySeed<'_, '_, V> {
    type Value = Rc<str>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Rc<str>, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl<'de, V> Visitor<'de> for KeySeed<'_, '_, V> {
    type Value = Rc<str>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_str<E>(self, key: &str) -> Result<Rc<str>, E> {
        Ok(self.0.key(key))
    }
}

impl Surroundings<'_> {
    /// The nearest field of one of these names around the object, in their order.
    pub(super) fn field(&self, names: &[&str]) -> Option<&JsonLeaf> {
        let mut outwards = self.objects.iter().rev();
        outwards.find_map(|fields| names.iter().find_map(|name| fields.get(name)))
    }

    /// The keys on the way here, from the outermost.
    pub(super) fn keys(&self) -> impl DoubleEndedIterator<Item = &str> {
        self.path.iter().filter_map(|step| match step {
            PathStep::Key(key) => Some(&**key),
            PathStep::Index(_) => None,
        })
    }

    /// The place of an element in its array.
    pub(super) fn index(&self) -> usize {
        match self.path.last() {
            Some(PathStep::Index(index)) => *index,
            _ => 0,
        }
    }

    /// A fault at this place.
    pub(super) fn fault(&self, code: &'static str, detail: &str) -> Fault {
        let steps = self.path.iter().map(|step| match step {
            PathStep::Key(key) => format!("/{}", key.replace('~', "~0").replace('/', "~1")),
            PathStep::Index(index) => format!("/{index}"),
        });
        at_pointer(steps.collect(), code, detail)
    }
}

impl Fields {
    /// The value of a field; none where it is `null`.
    pub(super) fn get(&self, name: &str) -> Option<&JsonLeaf> {
        let entry = self.0.iter().find(|(key, _)| &**key == name);
        entry
            .map(|(_, leaf)| leaf)
            .filter(|leaf| **leaf != JsonLeaf::Null)
    }

    /// Whether there is a field of that name, even if it is `null`.
    pub(super) fn has(&self, name: &str) -> bool {
        self.0.iter().any(|(key, _)| &**key == name)
    }
}

impl JsonLeaf {
    /// The cell that the leaf is where a value is looked for.
    pub(super) fn cell(&self) -> Cell<'_> {
        match self {
            Self::Null => Cell::Empty,
            Self::Bool(value) => Cell::Bool(*value),
            Self::Integer(value) => Cell::Integer(*value),
            Self::Number(value) => Cell::Number(*value),
            Self::Text(text) => Cell::Text(text),
            Self::List(_) | Self::Taken => Cell::Other("an array"),
            Self::Object(_) => Cell::Other("an object"),
        }
    }

    /// A text, or a number as one.
    pub(super) fn text(&self) -> Option<String> {
        match self {
            Self::Text(text) => Some(text.clone()),
            Self::Integer(number) => Some(number.to_string()),
            _ => None,
        }
    }

    /// Whether the leaf is the boolean `true`.
    pub(super) fn is_true(&self) -> bool {
        *self == Self::Bool(true)
    }
}
