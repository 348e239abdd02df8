//! What the paths of other protocols answer that is not a success: errors as those protocols tell them.

use utoipa::openapi::content::ContentBuilder;
use utoipa::openapi::path::Operation;
use utoipa::openapi::{Ref, RefOr, ResponseBuilder};

use crate::api::sinks::protocol::Protocol;

/// Adds the refusals of a protocol to an operation.
pub(super) fn describe(protocol: Protocol, operation: &mut Operation) {
    let mut refusals: Vec<(u16, &str)> = vec![
        (
            400,
            "Points are wrong, which are told; others are stored (`partial write: …`), unless all are wrong. \
             The agent does not send them again",
        ),
        (401, "The request brings no token of this server"),
        (
            403,
            "The token may not append, or not to a stream that the points go to; nothing is stored",
        ),
        (404, "There is no mapping of this name; nothing is stored"),
        (
            413,
            "The body is too large; nothing is stored. Agents send it again in parts",
        ),
        (415, "The body's encoding is not understood"),
        (421, "The server has another name than the request asks"),
        (500, "The server failed; nothing is stored"),
        (
            503,
            "The server is busy, the disk is full, or the body came too slowly; nothing is stored. \
             `Retry-After` says when to send it again",
        ),
    ];
    let schema = match protocol {
        Protocol::Influx1 => "Influx1Error",
        Protocol::Influx2 => {
            let too_much = "The caller asks too much at once, or its project has as much as it may; nothing is \
                            stored. `Retry-After` says when to send it again";
            refusals.push((429, too_much));
            "Influx2Error"
        }
        Protocol::Omf => "OmfAnswer",
    };
    for (status, text) in refusals {
        let content = ContentBuilder::new().schema(Some(Ref::from_schema_name(schema)));
        let response = ResponseBuilder::new()
            .description(text)
            .content("application/json", content.build());
        let responses = &mut operation.responses.responses;
        responses.insert(status.to_string(), RefOr::T(response.build()));
    }
}
