//! How a table would be read, looked at before it is stored.

use axum::extract::{Request, State};
use axum::http::StatusCode;

use super::body::{Bodies, unsupported};
use super::client::Client;
use super::datasets::{FileBytes, kind_of};
use super::error::Answer;
use super::http_headers::json;
use super::query::{FromQuery, Params, QueryReader};
use super::reading::{GivenOptions, ReadingQuery};
use crate::store::Layouts;
use greybox::intake::{self, Layout, MediaKind};

/// Bytes of a text at the most: only the beginning is looked at.
const TEXT_BYTES: u64 = 1 << 20;

/// What a client can do that sends more.
const ENOUGH: &str = "send the beginning of the text alone: 64 KiB are looked at";

/// How the beginning of a text is to be read.
pub struct AskedLayout(GivenOptions);

impl FromQuery for AskedLayout {
    fn read(query: &mut QueryReader) -> Self {
        Self(GivenOptions::read(query))
    }
}

/// Show how a table is read.
///
/// The body is the beginning of a text as it would be sent to `POST /v1/datasets`, with the same
/// options, of which the first 64 KiB are looked at; or the whole of a workbook or of a Parquet file. The answer has the first rows as they stand in the text,
/// what each line and each column is taken for, and what would be warned of or refused. Nothing is
/// stored. Of a text that is no table, such as line protocol, only the format is told.
#[utoipa::path(
    post, path = "/v1/layouts", operation_id = "show_layout", tag = "datasets",
    params(ReadingQuery),
    request_body(
        description = "The beginning of the text, or the whole of a file that is no text",
        content(
            (String = "text/csv", example = "time [s],position [mm]\n0,0\n0.01,1.2\n"),
            (String = "text/plain", example = "Zeit;Druck\ns;bar\n0;1,2\n1;1,3\n"),
            (FileBytes = "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet"),
            (FileBytes = "application/vnd.apache.parquet")
        )
    ),
    responses((status = 200, description = "How the beginning is read", body = Layout))
)]
pub async fn show(
    State(bodies): State<Bodies>,
    State(layouts): State<Layouts>,
    client: Client,
    Params(AskedLayout(options)): Params<AskedLayout>,
    request: Request,
) -> Answer {
    let options = options.completed(&layouts, &client.project).await?;
    let mut options = options.options()?;
    let (kind, charset) = kind_of(request.headers())?;
    if kind == MediaKind::Json {
        let taken = "text/csv, text/plain, application/vnd.apache.parquet and \
                     application/vnd.openxmlformats-officedocument.spreadsheetml.sheet";
        return Err(unsupported(request.headers(), taken));
    }
    if let Some(charset) = charset {
        options.assume_encoding(&charset);
    }
    let received = match kind {
        MediaKind::Binary => {
            bodies
                .receive(request.into_body(), bodies.dataset_bytes)
                .await?
        }
        _ => {
            let received = bodies.receive(request.into_body(), TEXT_BYTES).await;
            received.map_err(|problem| problem.or_instead(ENOUGH))?
        }
    };
    let layout = bodies.parse_received(received, move |text| {
        Ok(intake::layout(text, kind, &options)?)
    });
    Ok(json(StatusCode::OK, &layout.await?.value))
}
