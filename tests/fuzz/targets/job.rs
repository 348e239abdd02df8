//! The bytes of a job document, read against the catalogue and a recording of demo A.

#![no_main]

use greybox::recording::Summary;
use greybox::demo::{self, Demo};
use greybox::parsing;
use greybox::identification::DatasetId;
use greybox::identification::spec::{Context, JobSpec};
use greybox::model::Catalogue;
use libfuzzer_sys::fuzz_target;
use std::collections::HashMap;
use std::sync::LazyLock;

static MODELS: LazyLock<Catalogue> = LazyLock::new(Catalogue::built_in);

/// The recording under the name that the specification's example gives it.
static DATASETS: LazyLock<HashMap<DatasetId, Summary>> = LazyLock::new(|| {
    let id = "ds_0192d3a4b5c67d8e9f00112233445566".parse();
    let summary = demo::recording(Demo::A, 1).summary();
    HashMap::from([(id.expect("an identifier"), summary)])
});

fuzz_target!(|bytes: &[u8]| {
    let Ok(document) = parsing::json::parse(bytes) else {
        return;
    };
    let _ = JobSpec::datasets_named(&document);
    let context = Context {
        models: MODELS.iter().map(|model| model.description()).collect(),
        datasets: &DATASETS,
        versions: None,
        max_duration_s: 3600.0,
    };
    let Ok(spec) = JobSpec::read(&document, &context) else {
        return;
    };
    // A specification that was completed reads back to itself.
    let stored = serde_json::to_value(&spec).expect("a specification is JSON");
    let again = JobSpec::read(&stored, &context);
    assert_eq!(again.as_ref(), Ok(&spec), "{stored}");
});
