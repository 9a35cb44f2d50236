//! Undecoded messages. Their format depends on the DDS implementation of the sender.

use std::convert::Infallible;

use rustdds::RepresentationIdentifier;
use rustdds::no_key::{Decode, DefaultDecoder, DeserializerAdapter};

/// Bytes of a message, and their encoding.
pub(super) struct Raw {
    pub(super) bytes: Vec<u8>,
    pub(super) encoding: RepresentationIdentifier,
}

/// Deserializer that returns the bytes of a message.
pub(super) struct RawAdapter;

impl DeserializerAdapter<Raw> for RawAdapter {
    type Error = Infallible;
    type Decoded = Raw;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[
            RepresentationIdentifier::CDR_BE,
            RepresentationIdentifier::CDR_LE,
        ]
    }

    fn transform_decoded(decoded: Raw) -> Raw {
        decoded
    }
}

/// Decoder that copies the bytes.
#[derive(Clone)]
pub(super) struct RawDecoder;

impl Decode<'_, Raw> for RawDecoder {
    type Error = Infallible;

    fn decode_bytes(
        self,
        bytes: &[u8],
        encoding: RepresentationIdentifier,
    ) -> Result<Raw, Infallible> {
        let bytes = bytes.to_vec();
        Ok(Raw { bytes, encoding })
    }
}

impl DefaultDecoder<Raw> for RawAdapter {
    type Decoder = RawDecoder;
    const DECODER: RawDecoder = RawDecoder;
}
