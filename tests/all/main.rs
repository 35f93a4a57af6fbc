//! The whole program, what it is linked into, and its documents: one test program, since each of them links all there is.

#![allow(clippy::unwrap_used)]

mod bad_input;
mod batch;
mod compare;
mod cpp;
mod eval;
mod examples;
mod fixture;
mod inspect;
mod kills;
mod library;
mod licences;
mod links;
mod perturbed;
mod prepare;
mod prior;
mod real_input;
mod render;
mod report_page;
mod solve;
mod study;
