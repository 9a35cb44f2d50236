//! Arbitrary bytes as a network in any format. A valid network is written, and must be the same
//! when it is read again.

#![no_main]

use elbowroom_network::{read, write_json};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for name in ["network", "network.stnu"] {
        match read(name, bytes) {
            Ok(file) => {
                let written = write_json(&file);
                let again = read("again.json", written.as_bytes()).expect("what is written is right");
                assert_eq!(write_json(&again), written);
                assert_eq!(again.network, file.network);
            }
            Err(mistakes) => assert!(!mistakes.to_string().is_empty()),
        }
    }
});
