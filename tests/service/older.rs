//! A database that an older version wrote: it opens, its results are the same, the job that was at
//! work comes to what it came to there, and its monitor goes on. `older/make.py` made it with a build of
//! commit 2eabe3d (schema 44), in a file, while a job was at work.

use crate::app::TestApp;
use crate::monitors::Events;
use serde_json::Value;
use std::io::{Cursor, Read as _};

const PACKED: &[u8] = include_bytes!("older/2eabe3d.zip");

fn unpacked(name: &str) -> Vec<u8> {
    let mut packed = zip::ZipArchive::new(Cursor::new(PACKED)).unwrap();
    let mut bytes = Vec::new();
    packed
        .by_name(name)
        .unwrap()
        .read_to_end(&mut bytes)
        .unwrap();
    bytes
}

/// Whether `newer` says all that `older` says; fields may have been added.
#[track_caller]
fn says_all_of(newer: &Value, older: &Value, place: &str) {
    match (newer, older) {
        (Value::Object(newer), Value::Object(older)) => {
            for (name, value) in older {
                let place = format!("{place}/{name}");
                let same = newer.get(name).unwrap_or_else(|| panic!("{place} is gone"));
                says_all_of(same, value, &place);
            }
        }
        (Value::Array(newer), Value::Array(older)) if newer.len() == older.len() => {
            for (k, (newer, older)) in newer.iter().zip(older).enumerate() {
                says_all_of(newer, older, &format!("{place}/{k}"));
            }
        }
        _ => assert_eq!(newer, older, "{place}"),
    }
}

/// What assumptions contribute counts since then how far the residuals would have an assumption elsewhere, so that a job
/// that is finished now says more than it would have said.
fn without_contributions(mut result: Value) -> Value {
    for line in result["budget"].as_array_mut().expect("a budget") {
        line.as_object_mut()
            .expect("a line")
            .remove("contributions");
    }
    result
}

#[tokio::test]
async fn a_database_of_2eabe3d_opens_goes_on_and_answers_the_same() {
    let answers: Value = serde_json::from_slice(&unpacked("answers.json")).unwrap();
    let app = TestApp::on_file(&unpacked("greybox.db")).await;

    let results = |which: &str| answers[which].as_object().unwrap().clone().into_iter();
    let at_work = results("at_work").map(|(job, result)| (job, without_contributions(result)));
    for (job, result) in results("finished").chain(at_work) {
        assert_eq!(app.ended(&job).await["status"], "succeeded");
        let path = format!("/v1/jobs/{job}/result");
        says_all_of(&app.get(&path).await.expect(200).json(), &result, &path);
    }

    let monitor = answers["monitor"]["id"].as_str().unwrap();
    let path = format!("/v1/monitors/{monitor}");
    let windows = answers["monitor"]["windows"].as_array().unwrap().len();
    let shown = app.get(&path).await.expect(200).json();
    // Its status and alarms tell how long ago the last samples came.
    for field in ["spec", "windows"] {
        says_all_of(&shown[field], &answers["monitor"][field], field);
    }
    let mut events = Events::of(&app, monitor).await;
    let samples = answers["next_window"].as_str().unwrap().to_owned();
    app.post_csv("/v1/streams/lag", samples).await.expect(200);
    events.until_window(windows as u64).await;
    let shown = app.get(&path).await.expect(200).json();
    assert_eq!(shown["windows"].as_array().unwrap().len(), windows + 1);
}
