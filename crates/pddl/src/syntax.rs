//! Conversion of text to nested lists of words.

mod lexer;
mod tree;

pub(crate) use tree::{Kind, Node, parse};
