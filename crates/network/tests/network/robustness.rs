//! No reader panics on any bytes, and every parsed network can be written and read again.

use crate::samples;
use elbowroom_network::{read, write_graphml, write_json};
use proptest::prelude::*;

/// Pieces that mean something in one of the formats.
const PIECES: [&str; 24] = [
    "{",
    "}",
    "[",
    "]",
    ",",
    ":",
    "\"",
    "<",
    ">",
    "</",
    "/>",
    "&",
    "<!--",
    "<![CDATA[",
    "-",
    "1e400",
    "Infinity",
    "NaN",
    "\n",
    "# ",
    "\u{e9}",
    "0",
    "c <label> 99999999999 x\n",
    "p sp 1000000 1\n",
];

#[derive(Clone, Debug)]
enum Change {
    Remove(usize, usize),
    Insert(usize, usize),
    Copy(usize, usize, usize),
    Byte(usize, u8),
}

fn changes() -> impl Strategy<Value = Vec<Change>> {
    let place = 0..4000_usize;
    let length = 0..40_usize;
    let change = prop_oneof![
        (place.clone(), length.clone()).prop_map(|(at, length)| Change::Remove(at, length)),
        (place.clone(), 0..PIECES.len()).prop_map(|(at, piece)| Change::Insert(at, piece)),
        (place.clone(), place.clone(), length)
            .prop_map(|(from, to, length)| Change::Copy(from, to, length)),
        (place, any::<u8>()).prop_map(|(at, byte)| Change::Byte(at, byte)),
    ];
    prop::collection::vec(change, 1..6)
}

fn changed(text: &str, changes: &[Change]) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    for change in changes {
        let count = bytes.len() + 1;
        match *change {
            Change::Remove(at, length) => {
                let at = at % count;
                let end = (at + length).min(bytes.len());
                bytes.drain(at..end);
            }
            Change::Insert(at, piece) => {
                let at = at % count;
                bytes.splice(at..at, PIECES[piece].bytes());
            }
            Change::Copy(from, to, length) => {
                let from = from % count;
                let end = (from + length).min(bytes.len());
                let copied = bytes[from..end].to_vec();
                let to = to % count;
                bytes.splice(to..to, copied);
            }
            Change::Byte(at, byte) => {
                if let Some(place) = bytes.get_mut(at % count) {
                    *place = byte;
                }
            }
        }
    }
    bytes
}

fn holds_for(name: &str, bytes: &[u8]) -> Result<(), TestCaseError> {
    match read(name, bytes) {
        Err(mistakes) => {
            prop_assert!(mistakes.errors().next().is_some());
            for mistake in mistakes.iter() {
                prop_assert!(mistake.line() > 0 && mistake.column() > 0);
                prop_assert!(!mistake.message.is_empty() && mistake.advice.is_some());
                prop_assert!(!mistake.render(false).is_empty());
            }
        }
        Ok(file) => {
            let text = write_json(&file);
            let mut again = read("again.json", text.as_bytes()).expect(&text);
            again.format = file.format;
            again.remarks.clone_from(&file.remarks);
            prop_assert_eq!(&again, &file);
            if let Some(text) = write_graphml(&file) {
                let again = read("again.stnu", text.as_bytes()).map(|again| again.network);
                let is_plain = |point: &String| {
                    point.chars().all(|letter| !letter.is_control()) && point.trim() == point
                };
                if file.points.iter().all(is_plain) {
                    prop_assert_eq!(again.as_ref(), Ok(&file.network));
                }
            }
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6000))]

    #[test]
    fn changed_samples_are_read_or_refused(index in 0..samples::ALL.len(), changes in changes()) {
        let (name, text) = samples::ALL[index];
        holds_for(name, &changed(text, &changes))?;
    }

    #[test]
    fn any_bytes_are_read_or_refused(start in 0..6_usize, bytes in prop::collection::vec(any::<u8>(), 0..80)) {
        let mut all = ["", "{", "[", "<graphml>", "# Num ", "p sp 3 1\n"][start].as_bytes().to_vec();
        all.extend(bytes);
        holds_for("f", &all)?;
    }
}
