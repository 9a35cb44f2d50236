//! C interface of the module: memory management and one function.
//!
//! A host allocates a buffer with [`elbowroom_reserve`], writes a question in UTF-8 into it, and
//! calls [`elbowroom_ask`]. The result is the length of the reply in bytes, as a little-endian
//! 32-bit integer, followed by the reply in UTF-8. The host frees both buffers with
//! [`elbowroom_release`]. On WebAssembly the module imports one function, `now` from `elbowroom`:
//! milliseconds since a fixed moment, as a double.
//!
//! A panic makes the instance unusable; the host must create a new one.

#![allow(unsafe_code, reason = "callers in other languages pass addresses")]

use std::time::Duration;

/// Length of the head of a reply, in bytes.
const HEAD: usize = 4;

/// Allocates a buffer of `length` bytes. The host must release it.
#[unsafe(no_mangle)]
pub extern "C" fn elbowroom_reserve(length: usize) -> *mut u8 {
    into_raw_reply(vec![0; length])
}

/// Frees a buffer.
///
/// # Safety
/// `start` and `length` must be those of a buffer from [`elbowroom_reserve`], or of a reply with
/// its head, which has not been released before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn elbowroom_release(start: *mut u8, length: usize) {
    let slice = std::ptr::slice_from_raw_parts_mut(start, length);
    // SAFETY: by this function's contract, the memory is a boxed slice of that length from
    // `into_raw_reply`.
    drop(unsafe { Box::from_raw(slice) });
}

/// Returns the reply to a question.
///
/// # Safety
/// The host must have written `length` bytes at `start`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn elbowroom_ask(start: *const u8, length: usize) -> *mut u8 {
    // SAFETY: by this function's own contract.
    let question = unsafe { std::slice::from_raw_parts(start, length) };
    let question = String::from_utf8_lossy(question);
    let reply = crate::reply(&question, &mut now);
    let reply = serde_json::to_vec(&reply).unwrap_or_default();
    let count = u32::try_from(reply.len()).unwrap_or_default();
    let mut whole = Vec::with_capacity(HEAD + reply.len());
    whole.extend(count.to_le_bytes());
    whole.extend(reply);
    into_raw_reply(whole)
}

fn into_raw_reply(bytes: Vec<u8>) -> *mut u8 {
    Box::into_raw(bytes.into_boxed_slice()).cast()
}

#[cfg(target_arch = "wasm32")]
fn now() -> Duration {
    #[link(wasm_import_module = "elbowroom")]
    unsafe extern "C" {
        #[link_name = "now"]
        safe fn milliseconds() -> f64;
    }
    Duration::try_from_secs_f64(milliseconds() / 1000.0).unwrap_or_default()
}

/// Without a host there is no clock.
#[cfg(not(target_arch = "wasm32"))]
fn now() -> Duration {
    Duration::ZERO
}

#[cfg(test)]
mod tests {
    use super::{HEAD, elbowroom_ask, elbowroom_release, elbowroom_reserve};

    #[test]
    fn reply_has_length_prefix_and_can_be_released() {
        let question = b"no question";
        let room = elbowroom_reserve(question.len());
        // SAFETY: the buffer is as long as the question, and buffer and reply are both released
        // once.
        let reply = unsafe {
            room.copy_from_nonoverlapping(question.as_ptr(), question.len());
            let reply = elbowroom_ask(room, question.len());
            let mut head = [0; HEAD];
            head.copy_from_slice(std::slice::from_raw_parts(reply, HEAD));
            let length = u32::from_le_bytes(head) as usize;
            let text = std::slice::from_raw_parts(reply.add(HEAD), length).to_vec();
            elbowroom_release(room, question.len());
            elbowroom_release(reply, HEAD + length);
            text
        };
        let reply: serde_json::Value = serde_json::from_slice(&reply).unwrap();
        assert_eq!(reply["exit"], 2);
        let document = reply["document"].as_str().unwrap();
        assert!(
            document.contains("the question cannot be read"),
            "{document}"
        );
    }
}
