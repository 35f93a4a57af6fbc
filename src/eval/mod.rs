//! Metrics: a result against truth or against a turning platform.
