//! What acted on a plant beside its inputs, over the recording of a finished job.

use reqwest::Method;
use serde_json::{Value, json};

use crate::app::{TestApp, drive_job};
use crate::simulations::rig;

const SAMPLE_TIME: f64 = 0.02;
const SAMPLES: u32 = 500;
/// A load of 12 N stands on the rig from 4 s to 7 s, and nobody records it.
const LOAD: f64 = 12.0;
const LOADED: std::ops::Range<u32> = 200..350;

/// The position of the rig under a force that changes its sign now and then, in steps of 0.2 ms.
fn record() -> Value {
    let [mass, damping, stiffness] = [10.0, 20.0, 1000.0];
    let (mut x, mut v) = (0.0, 0.0);
    let (mut forces, mut positions) = (Vec::new(), Vec::new());
    for sample in 0..SAMPLES {
        let force = if (sample / 7 * 5) % 3 == 0 {
            10.0
        } else {
            -10.0
        };
        let load = if LOADED.contains(&sample) { LOAD } else { 0.0 };
        let noise = f64::from((sample * 7919) % 101) / 50.0 - 1.0;
        forces.push(force);
        positions.push(x + 1.7e-4 * noise);
        for _ in 0..100 {
            let push = |x: f64, v: f64| (force + load - damping * v - stiffness * x) / mass;
            let step = SAMPLE_TIME / 100.0;
            let middle = (x + 0.5 * step * v, v + 0.5 * step * push(x, v));
            x += step * middle.1;
            v += step * push(middle.0, middle.1);
        }
    }
    json!({
        "sample_time_s": SAMPLE_TIME,
        "signals": {"force": {"unit": "N", "values": forces},
                    "position": {"unit": "m", "values": positions}}
    })
}

/// A job that is told how the load moves, and has come to its end.
async fn disturbed_job(app: &TestApp) -> String {
    let stored = app.post_json("/v1/datasets", &record()).await.expect(201);
    let id = app
        .submit(&json!({
            "model": rig(),
            "experiments": [{"dataset": stored.json()["id"]}],
            "parameters": {"mass": {"estimate": {"lower": 5, "upper": 20}},
                           "stiffness": {"estimate": {"lower": 500, "upper": 2000}},
                           "damping": {"value": 20.0}},
            "outputs": {"position": {"noise_std": 1e-4}},
            "process_noise": [{"acts_on": {"parameter": "load"}, "kind": "memory",
                               "std": 3, "time_constant_s": 2}],
            "validation": {"fraction": 0.2},
            "method": {"population": 10, "generations": 5}, "seed": 1
        }))
        .await;
    assert_eq!(app.ended(&id).await["status"], "succeeded");
    id
}

fn numbers(series: &Value) -> Vec<f64> {
    let numbers = series.as_array().unwrap().iter();
    numbers
        .map(|value| value.as_f64().unwrap_or(f64::NAN))
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_load_that_nobody_recorded_is_shown_with_its_size_and_the_instants_at_which_it_changed() {
    let app = TestApp::start().await;
    let id = disturbed_job(&app).await;
    let path = format!("/v1/jobs/{id}/disturbance");
    let job = app.get(&format!("/v1/jobs/{id}")).await.json();
    assert_eq!(job["links"]["disturbance"], path.as_str());
    let answer = app.get(&path).await.expect(200).json();
    let experiment = &answer["experiments"][0];
    assert_eq!(experiment["span_s"], json!([0.0, 9.98]));
    assert_eq!(experiment["estimation_until_s"], 8.0);
    let disturbance = &experiment["disturbances"][0];
    assert_eq!(disturbance["acts_on"], json!({"parameter": "load"}));
    assert_eq!(disturbance["kind"], "memory");
    assert_eq!(disturbance["unit"], "N");
    assert!(disturbance["share_of_output"]["position"].as_f64() > Some(0.05));

    // Half a second from each change the load is the true one, within its error.
    let [value, deviation] = ["value", "deviation"].map(|series| numbers(&disturbance[series]));
    assert_eq!(value.len(), SAMPLES as usize);
    for (sample, truth) in [(150, 0.0), (240, LOAD), (320, LOAD), (400, 0.0), (450, 0.0)] {
        let off = (value[sample] - truth) / deviation[sample];
        assert!(off.abs() < 4.0, "{off} deviations off at sample {sample}");
        assert!(deviation[sample] < 2.0);
    }

    let events = disturbance["events"].as_array().unwrap();
    assert_eq!(disturbance["event_count"], events.len());
    for (change, instant) in [(LOAD, 4.0), (-LOAD, 7.0)] {
        let number = |event: &Value, field: &str| event[field].as_f64().unwrap();
        let event = events.iter().find(|event| {
            number(event, "start_s") <= instant && instant <= number(event, "end_s") + SAMPLE_TIME
        });
        let event = event.unwrap_or_else(|| panic!("no event at {instant} s: {events:?}"));
        assert!(number(event, "t") * change.signum() > 4.0, "{event}");
        let size = number(event, "size") / change;
        assert!((0.3..1.3).contains(&size), "{event}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_part_of_a_disturbance_has_every_sample_and_the_events_of_the_part() {
    let app = TestApp::start().await;
    let id = disturbed_job(&app).await;
    let path = format!("/v1/jobs/{id}/disturbance");
    let part = app
        .get(&format!("{path}?from=3.5&to=5&max_points=200"))
        .await;
    let part = part.expect(200).json();
    let experiment = &part["experiments"][0];
    let time = numbers(&experiment["time_s"]);
    assert_eq!((time[0], time[time.len() - 1], time.len()), (3.5, 5.0, 76));
    let events = experiment["disturbances"][0]["events"].as_array().unwrap();
    assert!(!events.is_empty());
    let is_outside = |event: &Value| event["start_s"].as_f64() > Some(5.0);
    assert!(!events.iter().any(is_outside), "{events:?}");
    let position = &experiment["outputs"]["position"];
    let [innovation, deviation] = ["innovation", "deviation"].map(|of| numbers(&position[of]));
    assert_eq!([innovation.len(), deviation.len()], [76, 76]);
    let states = experiment["states"].as_object().unwrap();
    assert_eq!(states.keys().collect::<Vec<_>>(), ["v", "x"]);

    let few = app.get(&format!("{path}?max_points=40")).await.json();
    assert!(numbers(&few["experiments"][0]["time_s"]).len() <= 40);

    let request = app.request(Method::GET, &path).header("accept", "text/csv");
    let csv = app.send(request).await.expect(200).text;
    assert_eq!(
        csv.lines().next(),
        Some(
            "experiment,time [s],load [N],load_deviation [N],load_t [1],x [m],x_deviation [m],\
             v [m/s],v_deviation [m/s],position_expected [m],position_innovation [m],\
             position_innovation_deviation [m]"
        )
    );
    assert_eq!(csv.lines().count(), 501);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_result_without_process_noise_says_why_there_is_no_disturbance() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let answers = [
        ("none", "the job says that nothing acts"),
        ("auto", "the residuals of the free run are white"),
    ];
    for (choice, why) in answers {
        let mut job = drive_job(&dataset);
        job["process_noise"] = json!(choice);
        let id = app.submit(&job).await;
        app.ended(&id).await;
        let problem = app.get(&format!("/v1/jobs/{id}/disturbance")).await;
        let problem = problem.problem(409);
        let detail = problem["detail"].as_str().unwrap();
        assert!(detail.contains(why), "{detail}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn disturbances_are_looked_for_unless_the_job_says_otherwise_or_needs_a_free_run() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let asked = [
        (json!({}), "auto"),
        (json!({"process_noise": "none"}), "none"),
        (json!({"uncertainty": {"intervals": "posterior"}}), "auto"),
        (json!({"uncertainty": {"intervals": "bootstrap"}}), "none"),
        (json!({"uncertainty": {"monte_carlo_samples": 100}}), "none"),
        (
            json!({"method": {"huber_threshold": 1.5}, "outputs": {"position": {"noise_std": 1e-3}}}),
            "none",
        ),
    ];
    for (more, expected) in asked {
        let mut job = drive_job(&dataset);
        let object = job.as_object_mut().unwrap();
        object.extend(more.as_object().unwrap().clone());
        let id = app.submit(&job).await;
        let stored = app.get(&format!("/v1/jobs/{id}")).await.json();
        assert_eq!(stored["spec"]["process_noise"], expected, "{more}");
    }
}
