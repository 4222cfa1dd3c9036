//! Failures, as read by the page.

use serde::Serialize;
use tumble_interface::{Issue, SceneError, StepError};

/// `Failure` of web/src/engine/protocol.ts, boxed: it is rare and large.
#[derive(Serialize)]
#[serde(transparent)]
pub struct Failure(Box<Words>);

#[derive(Serialize)]
struct Words {
    kind: &'static str,
    message: String,
    issues: Vec<Issue>,
    line: Option<usize>,
    path: Option<String>,
    missing: Vec<String>,
}

impl Failure {
    fn new(kind: &'static str, message: String) -> Self {
        Self(Box::new(Words { kind, message, issues: Vec::new(), line: None, path: None, missing: Vec::new() }))
    }

    /// More than the browser has.
    pub fn limit(message: String) -> Self {
        Self::new("limit", message)
    }

    /// A step that failed.
    pub fn step(error: &StepError) -> Self {
        Self::new("step", error.to_string())
    }

    /// The same, with the mesh files that are missing.
    pub fn missing(mut self, files: Vec<String>) -> Self {
        self.0.missing = files;
        self
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        let mut failure = Self::new("scene", error.to_string());
        failure.0.line = error.issues.first().and_then(|issue| issue.line);
        failure.0.path = error.issues.first().map(|issue| issue.path.clone());
        failure.0.issues = error.issues;
        failure
    }
}
