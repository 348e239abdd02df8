//! A small HTTP/1.1 client on a kept connection: it must cost less than what it measures.

use std::net::SocketAddr;

use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::Outcome;

/// A connection that is used for one request after the other.
pub struct Connection {
    stream: TcpStream,
    received: Vec<u8>,
}

/// What a server answered.
pub struct Answer<'a> {
    pub status: u16,
    head: &'a str,
    pub body: &'a [u8],
}

impl Answer<'_> {
    /// The value of a header, by its name in lower case.
    pub fn header(&self, name: &str) -> Option<&str> {
        header(self.head, name)
    }

    /// The body as JSON, if the status is the expected one.
    pub fn json(&self, status: u16) -> Outcome<Value> {
        if self.status != status {
            let body = String::from_utf8_lossy(self.body);
            return Err(format!("{} instead of {status}: {body}", self.status).into());
        }
        Ok(serde_json::from_slice(self.body)?)
    }
}

impl Connection {
    pub async fn open(address: SocketAddr) -> Outcome<Self> {
        let stream = TcpStream::connect(address).await?;
        stream.set_nodelay(true)?;
        Ok(Self {
            stream,
            received: Vec::new(),
        })
    }

    /// Sends a whole request and reads the whole answer.
    pub async fn ask(&mut self, request: &[u8]) -> Outcome<Answer<'_>> {
        self.stream.write_all(request).await?;
        self.received.clear();
        let head_end = loop {
            let read = self.stream.read_buf(&mut self.received).await?;
            if read == 0 {
                return Err("the server closed the connection".into());
            }
            if let Some(end) = find(&self.received, b"\r\n\r\n") {
                break end;
            }
        };
        let head = std::str::from_utf8(&self.received[..head_end])?;
        let status: u16 = head.get(9..12).unwrap_or_default().parse()?;
        let length = header(head, "content-length").map_or(Ok(0), str::parse::<usize>)?;
        let length = if matches!(status, 204 | 304) {
            0
        } else {
            length
        };
        let whole = head_end + 4 + length;
        while self.received.len() < whole {
            if self.stream.read_buf(&mut self.received).await? == 0 {
                return Err("the server cut its answer".into());
            }
        }
        Ok(Answer {
            status,
            head: std::str::from_utf8(&self.received[..head_end])?,
            body: &self.received[head_end + 4..whole],
        })
    }

    pub async fn get(&mut self, path: &str) -> Outcome<Value> {
        self.ask(&get(path, "")).await?.json(200)
    }

    pub async fn post(
        &mut self,
        path: &str,
        kind: &str,
        body: &[u8],
        status: u16,
    ) -> Outcome<Value> {
        self.ask(&post(path, kind, body)).await?.json(status)
    }
}

/// A `GET` with more header lines, each with its line end.
pub fn get(path: &str, headers: &str) -> Vec<u8> {
    format!("GET {path} HTTP/1.1\r\nhost: localhost\r\n{headers}\r\n").into_bytes()
}

/// A `POST` of a body.
pub fn post(path: &str, kind: &str, body: &[u8]) -> Vec<u8> {
    let length = body.len();
    let mut request = format!(
        "POST {path} HTTP/1.1\r\nhost: localhost\r\ncontent-type: {kind}\r\n\
         content-length: {length}\r\n\r\n"
    )
    .into_bytes();
    request.extend_from_slice(body);
    request
}

fn find(text: &[u8], what: &[u8]) -> Option<usize> {
    text.windows(what.len()).position(|window| window == what)
}

fn header<'a>(head: &'a str, name: &str) -> Option<&'a str> {
    let mut lines = head.split("\r\n").filter_map(|line| line.split_once(": "));
    lines
        .find(|(key, _)| key.eq_ignore_ascii_case(name))
        .map(|(_, value)| value)
}
