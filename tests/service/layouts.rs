//! How a table is read, looked at and said before it is stored.

use reqwest::Method;
use serde_json::json;

use crate::app::TestApp;

#[tokio::test(flavor = "multi_thread")]
async fn a_layout_that_is_in_doubt_is_shown_said_and_then_stored() {
    let app = TestApp::start().await;
    let rows = (0..8).flat_map(|k| ["A", "B"].map(|unit| format!("{k},{unit},{k}.5,3\n")));
    let text = format!(
        "# hall 2\ntime [s],machine,p [bar],T\n{}",
        rows.collect::<String>()
    );
    let shown = app.post_csv("/v1/layouts", text.clone()).await.expect(200);
    let shown = shown.json();
    assert_eq!(
        (&shown["format"], &shown["delimiter"]),
        (&json!("wide_csv"), &json!(","))
    );
    assert_eq!(
        (&shown["header_row"], &shown["unit_row"]),
        (&json!(2), &json!(null))
    );
    assert_eq!(shown["rows"][0], json!({"line": 1, "fields": ["# hall 2"]}));
    assert_eq!(shown["faults"][0]["code"], "layout_unclear");
    let refused = app.post_csv("/v1/datasets", text.clone()).await.expect(422);
    let asked = &refused.json()["errors"][0];
    assert_eq!(asked["code"], "layout_unclear");
    assert_eq!(asked["parameter"], shown["faults"][0]["parameter"]);
    let shown = app.post_csv("/v1/layouts?tag=machine", text.clone()).await;
    let shown = shown.expect(200).json();
    let roles = shown["columns"].as_array().unwrap();
    let roles: Vec<_> = roles.iter().map(|column| &column["role"]).collect();
    assert_eq!(roles, ["time", "tag", "value", "value"]);
    assert_eq!(shown["faults"], json!([]));
    let stored = app.post_csv("/v1/datasets?tag=machine", text).await;
    let stored = stored.expect(201).json();
    let names = stored["signals"].as_array().unwrap().iter();
    assert_eq!(
        names.map(|signal| &signal["name"]).collect::<Vec<_>>(),
        ["A.p", "A.T", "B.p", "B.T"]
    );
    // Nothing but the recording was stored.
    let all = app.get("/v1/datasets").await.expect(200).json();
    assert_eq!(all["items"].as_array().unwrap().len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_no_table_of_text_is_told_and_too_much_is_refused() {
    let app = TestApp::start().await;
    let lines = app.post_csv(
        "/v1/layouts?format=influx_line_protocol",
        "rig p=1 1465839830100400200\n",
    );
    let lines = lines.await.expect(200).json();
    assert_eq!(
        (&lines["delimiter"], &lines["columns"]),
        (&json!(null), &json!([]))
    );
    app.post_json("/v1/layouts", &json!([])).await.expect(415);
    let damaged = app.post_csv("/v1/layouts", "PK\u{3}\u{4} a workbook");
    let damaged = damaged.await.expect(400).json();
    assert_eq!(damaged["errors"][0]["code"], "not_a_workbook");
    let wrong = app
        .post_csv("/v1/layouts?header_row=0&unit_row=x", "t,p\n")
        .await;
    let wrong = wrong.expect(422).json();
    let parameters = wrong["errors"].as_array().unwrap().iter();
    let parameters: Vec<_> = parameters.map(|fault| &fault["parameter"]).collect();
    assert_eq!(parameters, ["header_row", "unit_row"]);
    app.post_csv("/v1/layouts", "0,1\n".repeat(1 << 18) + "0")
        .await
        .expect(413);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_workbook_is_shown_by_its_sheets_and_read_without_a_row() {
    let app = TestApp::start().await;
    let workbook = include_bytes!("../../crates/recording/tests/payloads/excel/nasty.xlsx");
    let send = |path: &str| {
        let request = app.request(Method::POST, path).body(workbook.to_vec());
        app.send(request.header("content-type", "application/octet-stream"))
    };
    let cover = send("/v1/layouts").await.expect(200).json();
    assert_eq!(cover["file"], "excel");
    assert_eq!(cover["sheets"], json!(["cover", "samples"]));
    assert!(!cover["faults"].as_array().unwrap().is_empty());
    let options = "sheet=samples&tz=UTC&skip=2-3";
    let shown = send(&format!("/v1/layouts?{options}")).await.expect(200);
    let shown = shown.json();
    assert_eq!(
        (&shown["sheet"], &shown["format"]),
        (&json!("samples"), &json!("long_csv"))
    );
    assert_eq!(shown["faults"], json!([]));
    let stored = send(&format!("/v1/datasets?{options}")).await.expect(201);
    // The rows of the first second are left out.
    assert_eq!(stored.json()["start"], "2026-03-02T09:15:01Z");
}
