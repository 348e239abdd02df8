//! One walk through a document of JSON.

use super::super::error::{ReadError, at_pointer, malformed};
use super::super::json;
use super::super::memory::Memory;
use super::held_text::DocumentText;
use super::leaf::{Fields, JsonLeaf};
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

/// Where an object stands: the objects around it, from the outermost, as far as they were read.
pub(super) struct Surroundings<'w> {
    pub(super) objects: &'w [Fields],
    path: &'w [PathStep],
    /// How many steps of the path number the documents of a text of several.
    document_steps: usize,
}

/// An object around a place, and the way from it to the place.
#[derive(Clone, Copy)]
pub(super) struct NestingLevel<'w> {
    /// The key of the field through which the way leads.
    pub(super) key: &'w str,
    /// The fields of the object, as far as they were read.
    pub(super) fields: &'w Fields,
    /// The place of the object in its list, where it stands in one.
    pub(super) index: Option<usize>,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum PathStep {
    Key(Rc<str>),
    Index(usize),
}

/// Who is handed what is met.
pub(super) trait Visit {
    /// An object that is complete. Answers whether it took it.
    fn object(&mut self, around: &Surroundings<'_>, fields: &Fields) -> bool;

    /// An array of scalars within an array. Answers whether it took it.
    fn row(&mut self, around: &Surroundings<'_>, cells: &[JsonLeaf]) -> bool;

    /// Elements of a list that were not taken, where others of the list were.
    fn left_over(&mut self, _around: &Surroundings<'_>, _elements: usize) {}

    /// Whether lists of objects and of lists that were not taken are kept for the object around them.
    fn keeps_lists(&self) -> bool {
        false
    }

    /// Whether reading on is pointless.
    fn is_full(&self) -> bool;
}

/// Walks through the document. Values that wait for the end of their list or object take memory.
pub(super) fn walk(
    text: DocumentText<impl Read>,
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
        document_steps: 0,
        keys: Vec::new(),
        spare: Vec::new(),
    };
    let walked = match text {
        DocumentText::Held(text) => {
            through(serde_json::Deserializer::from_slice(&text), &mut walker)
        }
        DocumentText::Streamed(source) => {
            through(serde_json::Deserializer::from_reader(source), &mut walker)
        }
    };
    memory.release(walker.held);
    match walker.refusal {
        Some(detail) => Err(malformed(Fault::of_whole("too_much_memory", detail))),
        None => walked.map_err(json::from_json),
    }
}

fn through<'t, V: Visit>(
    mut text: serde_json::Deserializer<impl serde_json::de::Read<'t>>,
    walker: &mut Walker<'_, V>,
) -> Result<(), serde_json::Error> {
    let (mut taken, mut left) = (0, 0);
    for document in 1.. {
        let node = LeafSeed {
            walker: &mut *walker,
            in_list: false,
        };
        let leaf = node.deserialize(&mut text)?;
        match leaf {
            JsonLeaf::Taken => taken += 1,
            _ => left += 1,
        }
        // Objects on lines of their own are documents that follow each other.
        match text.end() {
            Err(error) if !walker.visit.is_full() => {
                if error.is_io() || leaf.is_scalar() {
                    return Err(error);
                }
            }
            _ => break,
        }
        walker.path = vec![PathStep::Index(document)];
        walker.document_steps = 1;
    }
    if taken > 0 && left > 0 {
        walker.path.clear();
        walker.leave_over(left);
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
    document_steps: usize,
    keys: Vec<Rc<str>>,
    /// Lists of fields that are empty and have room.
    spare: Vec<Fields>,
}

impl<V: Visit> Walker<'_, V> {
    /// Hands over a row of scalars; answers whether it was taken.
    fn hand_over(&mut self, cells: &[JsonLeaf]) -> bool {
        let around = Surroundings {
            objects: &self.objects,
            path: &self.path,
            document_steps: self.document_steps,
        };
        self.visit.row(&around, cells)
    }

    /// Tells of elements that were not taken beside others that were.
    fn leave_over(&mut self, elements: usize) {
        let around = Surroundings {
            objects: &self.objects,
            path: &self.path,
            document_steps: self.document_steps,
        };
        self.visit.left_over(&around, elements);
    }
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
        let (mut elements, mut taken, mut all_scalars) = (Vec::new(), 0, true);
        let keeps_lists = walker.visit.keeps_lists();
        let held = walker.held;
        for index in 0.. {
            walker.path.push(PathStep::Index(index));
            let node = LeafSeed {
                walker: &mut *walker,
                in_list: true,
            };
            let element = seq.next_element_seed(node)?;
            walker.path.pop();
            let Some(leaf) = element else {
                break;
            };
            let is_scalar = leaf.is_scalar();
            all_scalars &= is_scalar;
            if leaf == JsonLeaf::Taken {
                taken += 1;
            } else if is_scalar || keeps_lists {
                walker.hold(&leaf, VALUE_BYTES)?;
                elements.push(leaf);
            }
        }
        let is_row = self.in_list && all_scalars;
        let is_kept = all_scalars || keeps_lists && taken == 0;
        if is_row && walker.hand_over(&elements) || !is_kept {
            walker.let_go(held);
            if keeps_lists && !elements.is_empty() && !is_row {
                walker.leave_over(elements.len());
            }
            return Ok(JsonLeaf::Taken);
        }
        Ok(JsonLeaf::List(elements))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<JsonLeaf, A::Error> {
        let walker = self.walker;
        let fields = walker.spare.pop().unwrap_or_default();
        walker.objects.push(fields);
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
        let mut fields = walker.objects.pop().expect("this object's fields");
        let around = Surroundings {
            objects: &walker.objects,
            path: &walker.path,
            document_steps: walker.document_steps,
        };
        let is_taken = walker.visit.is_full() || walker.visit.object(&around, &fields);
        if is_taken {
            walker.let_go(held);
            fields.0.clear();
            walker.spare.push(fields);
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

    /// The objects around, from the innermost.
    pub(super) fn levels(&self) -> Vec<NestingLevel<'_>> {
        let mut objects = self.objects.iter();
        let (mut index, mut levels) = (None, Vec::with_capacity(self.objects.len()));
        for (k, step) in self.path.iter().enumerate() {
            match step {
                PathStep::Index(place) => index = (k >= self.document_steps).then_some(*place),
                PathStep::Key(key) => levels.extend(objects.next().map(|fields| NestingLevel {
                    key,
                    fields,
                    index: index.take(),
                })),
            }
        }
        levels.reverse();
        levels
    }

    /// The path of the list around, with the place of that list in another one.
    pub(super) fn list(&self) -> (&[PathStep], Option<usize>) {
        let list = match self.path.split_last() {
            Some((PathStep::Index(_), list)) => list,
            _ => self.path,
        };
        let index = match list.last() {
            Some(PathStep::Index(index)) if list.len() > self.document_steps => Some(*index),
            _ => None,
        };
        (list, index)
    }

    /// The place of an element in its list, where it stands in one.
    pub(super) fn place_in_list(&self) -> Option<usize> {
        match self.path.last() {
            Some(PathStep::Index(index)) if self.path.len() > self.document_steps => Some(*index),
            _ => None,
        }
    }

    /// The key of the field that the place is, where it is one.
    pub(super) fn field_key(&self) -> Option<&str> {
        match self.path.last() {
            Some(PathStep::Key(key)) => Some(key),
            _ => None,
        }
    }

    /// The place of an element in its array.
    pub(super) fn index(&self) -> usize {
        match self.path.last() {
            Some(PathStep::Index(index)) => *index,
            _ => 0,
        }
    }

    /// The place as a pointer.
    pub(super) fn pointer(&self) -> String {
        let steps = self.path.iter().map(|step| match step {
            PathStep::Key(key) => format!("/{}", key.replace('~', "~0").replace('/', "~1")),
            PathStep::Index(index) => format!("/{index}"),
        });
        steps.collect()
    }

    /// A fault at this place.
    pub(super) fn fault(&self, code: &'static str, detail: &str) -> Fault {
        at_pointer(self.pointer(), code, detail)
    }
}
