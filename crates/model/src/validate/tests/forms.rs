//! Parser of texts in parentheses.

/// A word, or a list in parentheses.
#[derive(Clone, Debug)]
pub(super) enum Form {
    Word(String),
    List(Vec<Form>),
}

pub(super) fn head(parts: &[Form]) -> &str {
    match &parts[0] {
        Form::Word(word) => word,
        Form::List(_) => panic!("{parts:?}"),
    }
}

/// Returns the words of a flat list, or the word itself.
pub(super) fn words(form: &Form) -> Vec<&str> {
    match form {
        Form::Word(word) => vec![word],
        Form::List(parts) => parts
            .iter()
            .filter_map(|part| match part {
                Form::Word(word) => Some(word.as_str()),
                Form::List(_) => None,
            })
            .collect(),
    }
}

pub(super) fn forms(text: &str) -> Vec<Form> {
    let spaced = text.replace('(', " ( ").replace(')', " ) ");
    let mut stack = vec![Vec::new()];
    for token in spaced.split_whitespace() {
        match token {
            "(" => stack.push(Vec::new()),
            ")" => {
                let list = stack.pop().expect("balanced");
                stack.last_mut().expect("balanced").push(Form::List(list));
            }
            word => stack
                .last_mut()
                .expect("balanced")
                .push(Form::Word(word.to_owned())),
        }
    }
    assert_eq!(stack.len(), 1, "unbalanced: {text}");
    stack.remove(0)
}
