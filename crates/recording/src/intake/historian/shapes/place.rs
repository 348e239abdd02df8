//! Where in a document an object stands, and what is around it.

use super::super::super::error::at_pointer;
use super::super::leaf::Fields;
use super::super::walk::{NestingLevel, Surroundings};
use super::naming::LabelledName;
use greybox_numerics::parsing::Fault;

/// The place of an object.
pub(super) struct DocumentPlace<'p> {
    pub(super) around: &'p Surroundings<'p>,
    /// The objects around, from the innermost.
    pub(super) levels: Vec<NestingLevel<'p>>,
    /// The place of the object in its list.
    index: Option<usize>,
    /// No name can come any more that is not known yet.
    pub(super) is_last: bool,
    /// A list of samples is at the place, or around it.
    is_listed: bool,
    /// The way from `around` to the place, as the end of a pointer.
    inner: String,
    /// How many objects that were kept lie on this way.
    steps: usize,
}

/// The most objects that were kept on the way to a place: each level looks again at all that was kept within it.
const MOST_STEPS: usize = 8;

impl<'p> DocumentPlace<'p> {
    /// The place of an object that is complete, within others that may not be.
    pub(super) fn of(around: &'p Surroundings<'p>) -> Self {
        let levels = around.levels();
        Self {
            around,
            is_last: levels.is_empty(),
            levels,
            index: around.place_in_list(),
            is_listed: around.place_in_list().is_some(),
            inner: String::new(),
            steps: 0,
        }
    }

    /// The place of what a field of the object at this place holds, at `index` where that is a list.
    pub(super) fn within(
        &self,
        key: &'p str,
        fields: &'p Fields,
        index: Option<usize>,
    ) -> DocumentPlace<'p> {
        let level = NestingLevel {
            key,
            fields,
            index: self.index,
        };
        let is_outermost = self.levels.is_empty() || self.around.field_key().is_none();
        DocumentPlace {
            around: self.around,
            levels: std::iter::once(level)
                .chain(self.levels.iter().copied())
                .collect(),
            index,
            is_listed: index.is_some(),
            is_last: self.is_last || is_outermost,
            inner: match index {
                Some(index) => format!("{}/{key}/{index}", self.inner),
                None => format!("{}/{key}", self.inner),
            },
            steps: self.steps + 1,
        }
    }

    /// The place of a row whose key is its number.
    pub(super) fn of_numbered(self) -> Self {
        let mut levels = self.levels;
        if let Some(level) = levels.first_mut() {
            level.key = "rows";
        }
        Self { levels, ..self }
    }

    /// The number that the key of the object is.
    pub(super) fn number(&self) -> Option<u64> {
        let key = self.levels.first().filter(|_| self.index.is_none())?.key;
        key.parse().ok()
    }

    /// The name that the objects around give. None where it may still come.
    pub(super) fn name(&self) -> Option<LabelledName> {
        let name = self.name_by_now();
        (self.is_last || name.short.is_some()).then_some(name)
    }

    /// The name of the samples that the object at this place is a list of.
    pub(super) fn name_of_list(&self) -> Option<LabelledName> {
        let name = LabelledName::of(&self.levels, true);
        (self.is_last || name.short.is_some()).then_some(name)
    }

    /// The name that the objects around give as far as they were read.
    pub(super) fn name_by_now(&self) -> LabelledName {
        LabelledName::of(&self.levels, self.is_listed)
    }

    /// Whether so many objects were kept on the way that none is looked at any more.
    pub(super) fn is_too_deep(&self) -> bool {
        self.steps > MOST_STEPS
    }

    /// The place, where a list of samples is there.
    pub(super) fn listed(mut self) -> Self {
        self.is_listed = true;
        self
    }

    pub(super) fn fault(&self, code: &'static str, detail: &str) -> Fault {
        at_pointer(
            format!("{}{}", self.around.pointer(), self.inner),
            code,
            detail,
        )
    }
}
