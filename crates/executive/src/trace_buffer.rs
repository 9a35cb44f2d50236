//! In-memory buffer of the trace of a run, read by HTTP clients.

use std::collections::VecDeque;
use std::io::{self, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Interval of keep-alive comments to clients without news, to detect clients that have disconnected.
const KEEP_ALIVE: Duration = Duration::from_secs(15);

/// Time limit for clients to read the end of the run.
const DRAIN_TIMEOUT: Duration = Duration::from_secs(2);

/// Interval between two checks that a waiting client is still connected.
const POLL_INTERVAL: Duration = Duration::from_millis(250);

/// Client that receives new lines.
pub trait Subscriber: Write {
    /// Returns `true` if the client has closed its connection.
    fn has_disconnected(&mut self) -> bool;
}

/// Name of the trace on its page.
pub const TRACE_NAME: &str = "the run";

/// Limit on the trace that is kept of a persistent run, in bytes.
const MAX_KEPT_BYTES: usize = 4_000_000;

/// Trace of a run so far, or its last part if the buffer is bounded. Clones share the same buffer.
#[derive(Clone, Default)]
pub struct TraceBuffer(Arc<Shared>);

/// New lines of a trace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewLines {
    /// The lines, without their line feeds.
    pub lines: Vec<String>,
    /// Number of earlier lines that are no longer kept.
    pub missed: usize,
    /// Number of the last line.
    pub last: usize,
    /// `true` if the run has ended: no further lines follow.
    pub is_finished: bool,
}

#[derive(Default)]
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
    /// Cached document of the page, with the number of lines that it covers.
    document: Mutex<Option<(usize, Arc<str>)>>,
    /// Limit on the kept lines, in bytes.
    max_bytes: Option<usize>,
}

#[derive(Default)]
struct State {
    /// First line: the specification of the run.
    header: Option<Arc<str>>,
    /// Last lines.
    kept: VecDeque<Arc<str>>,
    /// Length of the kept lines in bytes.
    bytes: usize,
    /// Number of omitted lines between the header and the kept ones.
    omitted: usize,
    is_finished: bool,
    /// Number of clients that read the stream.
    listeners: usize,
}

impl State {
    fn lines(&self) -> usize {
        usize::from(self.header.is_some()) + self.omitted + self.kept.len()
    }

    fn add(&mut self, line: &str) {
        if self.header.is_none() {
            self.header = Some(line.into());
        } else {
            self.bytes += line.len();
            self.kept.push_back(line.into());
        }
    }

    /// Drops the first lines until at most `most` bytes remain, and further to the next request for a plan if there
    /// is one: a trace that begins there is self-contained.
    fn shorten(&mut self, most: usize) {
        let mut left = self.bytes;
        let mut cut = 0;
        let mut is_enough = false;
        for (index, line) in self.kept.iter().enumerate() {
            if left <= most && !is_enough {
                (cut, is_enough) = (index, true);
            }
            if is_enough && line.starts_with(r#"{"event":"planning""#) {
                cut = index;
                break;
            }
            left -= line.len();
        }
        for line in self.kept.drain(..cut) {
            self.bytes -= line.len();
            self.omitted += 1;
        }
    }

    /// Returns the kept lines after line `sent`, and the number of omitted lines after it.
    fn after(&self, sent: usize) -> (Vec<Arc<str>>, usize) {
        let header = self.header.iter().filter(|_| sent == 0).cloned();
        let of_kept = sent.saturating_sub(1 + self.omitted);
        let missed = (1 + self.omitted).saturating_sub(sent.max(1));
        let news = header.chain(self.kept.iter().skip(of_kept).cloned());
        (news.collect(), missed)
    }

    fn trace(&self) -> String {
        let lines = self.header.iter().chain(&self.kept);
        lines.map(|line| &**line).collect()
    }
}

impl TraceBuffer {
    /// Creates a buffer for a persistent run: it keeps the last 4 MB of the trace.
    pub fn bounded() -> Self {
        Self::with_limit(MAX_KEPT_BYTES)
    }

    fn with_limit(most: usize) -> Self {
        Self(Arc::new(Shared {
            max_bytes: Some(most),
            ..Shared::default()
        }))
    }

    /// Appends a line of the trace, which ends with its line feed.
    pub fn add(&self, line: &str) {
        let mut state = self.lock();
        state.add(line);
        if let Some(most) = self.0.max_bytes
            && state.bytes > most
        {
            state.shorten(most / 2);
        }
        drop(state);
        self.0.changed.notify_all();
    }

    /// Returns the kept trace.
    pub fn trace(&self) -> String {
        self.lock().trace()
    }

    /// Returns the number of the last omitted line, or `None` if the trace is complete. The header is line 1 and is
    /// always kept.
    pub fn last_omitted_line(&self) -> Option<usize> {
        let left_out = self.lock().omitted;
        (left_out > 0).then_some(left_out + 1)
    }

    /// Marks the run as finished, and waits up to two seconds for clients to read its end.
    pub fn close(&self) {
        let mut state = self.lock();
        state.is_finished = true;
        self.0.changed.notify_all();
        let waits = |state: &mut State| state.listeners > 0;
        state = self
            .0
            .changed
            .wait_timeout_while(state, DRAIN_TIMEOUT, waits)
            .unwrap_or_else(PoisonError::into_inner)
            .0;
        drop(state);
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // A thread that panicked while it held the lock has left complete lines.
        let state = self.0.state.lock();
        state.unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the document of the page as JSON. It is cached for all clients.
    ///
    /// # Errors
    /// When the page cannot be made from the trace.
    pub fn document(&self) -> Result<Arc<str>, String> {
        let cached = self.0.document.lock();
        let mut cached = cached.unwrap_or_else(PoisonError::into_inner);
        let (lines, left_out, trace) = {
            let state = self.lock();
            if let Some((lines, document)) = &*cached
                && *lines == state.lines()
            {
                return Ok(Arc::clone(document));
            }
            (state.lines(), state.omitted, state.trace())
        };
        let document = elbowroom_page::live_document(TRACE_NAME, &trace, left_out)
            .map_err(|error| error.to_string())?;
        let text = serde_json::to_string(&document).map_err(|error| error.to_string())?;
        let text: Arc<str> = text.into();
        *cached = Some((lines, Arc::clone(&text)));
        Ok(text)
    }

    /// Returns the page of the run up to now as HTML.
    ///
    /// # Errors
    /// When the page cannot be made from the trace.
    pub fn page(&self) -> Result<String, String> {
        let (trace, left_out) = {
            let state = self.lock();
            (state.trace(), state.omitted)
        };
        elbowroom_page::live_page(TRACE_NAME, &trace, left_out).map_err(|error| error.to_string())
    }

    /// Returns the lines after line `sent`, without their line feeds. Waits for at most `timeout` if there are none and
    /// the run continues.
    pub fn lines_after(&self, sent: usize, timeout: Duration) -> NewLines {
        self.wait_for_lines(sent, timeout);
        let state = self.lock();
        let (news, missed) = state.after(sent.min(state.lines()));
        NewLines {
            lines: news
                .iter()
                .map(|line| line.trim_end_matches('\n').to_owned())
                .collect(),
            missed,
            last: state.lines(),
            is_finished: state.is_finished,
        }
    }

    /// Waits until there are more than `seen` lines or the run ends, for at most `timeout`. Returns the number of lines,
    /// and `true` if the run has ended.
    pub(crate) fn wait_for_lines(&self, seen: usize, timeout: Duration) -> (usize, bool) {
        let waits = |state: &mut State| state.lines() <= seen && !state.is_finished;
        let waited = self
            .0
            .changed
            .wait_timeout_while(self.lock(), timeout, waits);
        let (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        (state.lines(), state.is_finished)
    }

    /// Sends an event for each change, until the run ends or the client disconnects.
    ///
    /// # Errors
    /// When the client cannot be written to.
    pub fn stream_changes(&self, client: &mut dyn Subscriber) -> io::Result<()> {
        self.with_listener_count(|| self.stream_all_changes(client))
    }

    /// Sends each line of the trace after line `after`, or each new line, until the run ends or the client
    /// disconnects.
    ///
    /// # Errors
    /// When the client cannot be written to.
    pub fn stream_lines(
        &self,
        after: Option<usize>,
        client: &mut dyn Subscriber,
    ) -> io::Result<()> {
        self.with_listener_count(|| self.stream_all_lines(after, client))
    }

    /// Counts a client while it reads a stream.
    pub(crate) fn with_listener_count(
        &self,
        stream: impl FnOnce() -> io::Result<()>,
    ) -> io::Result<()> {
        self.lock().listeners += 1;
        let streamed = stream();
        self.lock().listeners -= 1;
        self.0.changed.notify_all();
        streamed
    }

    /// Waits until the trace has more than `sent` lines or is complete, for at most [`KEEP_ALIVE`].
    ///
    /// # Errors
    /// When the client has disconnected.
    fn await_lines(
        &self,
        sent: usize,
        client: &mut dyn Subscriber,
    ) -> io::Result<MutexGuard<'_, State>> {
        let waits = |state: &mut State| state.lines() <= sent && !state.is_finished;
        let mut waited = Duration::ZERO;
        loop {
            let changed = &self.0.changed;
            let state = changed.wait_timeout_while(self.lock(), POLL_INTERVAL, waits);
            let (state, timeout) = state.unwrap_or_else(PoisonError::into_inner);
            waited += POLL_INTERVAL;
            if !timeout.timed_out() || waited >= KEEP_ALIVE {
                return Ok(state);
            }
            drop(state);
            if client.has_disconnected() {
                return Err(io::ErrorKind::ConnectionAborted.into());
            }
        }
    }

    fn stream_all_changes(&self, client: &mut dyn Subscriber) -> io::Result<()> {
        let mut sent = 0;
        loop {
            let (lines, is_over) = {
                let state = self.await_lines(sent, client)?;
                (state.lines(), state.is_finished)
            };
            if is_over {
                let document = self.document().map_err(io::Error::other)?;
                write!(client, "event: over\ndata: {document}\n\n")?;
                return client.flush();
            }
            if lines == sent {
                client.write_all(b": nothing new\n\n")?;
            } else {
                sent = lines;
                write!(client, "event: change\ndata: {lines}\n\n")?;
            }
            client.flush()?;
        }
    }

    fn stream_all_lines(
        &self,
        after: Option<usize>,
        client: &mut dyn Subscriber,
    ) -> io::Result<()> {
        let mut sent = after.unwrap_or_else(|| self.lock().lines());
        loop {
            let (news, missed, lines, is_over) = {
                let state = self.await_lines(sent, client)?;
                sent = sent.min(state.lines());
                let (news, missed) = state.after(sent);
                (news, missed, state.lines(), state.is_finished)
            };
            if missed > 0 {
                // The client reads too slowly: report the number of omitted lines.
                write!(client, "event: missed\ndata: {missed}\n\n")?;
            }
            let first = lines - news.len();
            for (number, line) in (first + 1..).zip(&news) {
                write!(client, "id: {number}\nevent: entry\ndata: {line}\n")?;
            }
            sent = lines;
            if is_over {
                client.write_all(b"event: over\ndata: {}\n\n")?;
                return client.flush();
            }
            if news.is_empty() {
                client.write_all(b": nothing new\n\n")?;
            }
            client.flush()?;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{Subscriber, TraceBuffer};

    impl Subscriber for Vec<u8> {
        fn has_disconnected(&mut self) -> bool {
            false
        }
    }

    /// Every fifth line is a request for a plan.
    fn line(number: usize) -> String {
        let event = if number.is_multiple_of(5) {
            "planning"
        } else {
            "passed"
        };
        format!("{{\"event\":\"{event}\",\"now\":{number:04}}}\n")
    }

    fn filled(most: Option<usize>, lines: usize) -> TraceBuffer {
        let buffer = most.map_or_else(TraceBuffer::default, TraceBuffer::with_limit);
        buffer.add("header\n");
        (2..=lines).for_each(|number| buffer.add(&line(number)));
        buffer
    }

    fn streamed(buffer: &TraceBuffer, after: Option<usize>) -> String {
        let mut bytes = Vec::new();
        buffer.lock().is_finished = true;
        buffer.stream_lines(after, &mut bytes).expect("to memory");
        String::from_utf8(bytes).expect("text")
    }

    #[test]
    fn unbounded_buffer_keeps_whole_trace() {
        let buffer = filled(None, 1000);
        assert_eq!(buffer.trace().lines().count(), 1000);
        assert_eq!(buffer.last_omitted_line(), None);
        assert_eq!(
            streamed(&buffer, Some(0)).matches("event: entry").count(),
            1000
        );
        assert!(streamed(&buffer, Some(998)).starts_with("id: 999\n"));
    }

    /// A bounded buffer keeps the header and a last part of limited length that begins with a request for a plan.
    /// Lines keep their numbers.
    #[test]
    fn bounded_buffer_keeps_header_and_last_part() {
        let most = 3000;
        for lines in (2..600).step_by(7) {
            let buffer = filled(Some(most), lines);
            let trace = buffer.trace();
            let kept: Vec<&str> = trace.lines().collect();
            assert_eq!(kept[0], "header");
            assert!(trace.len() <= most + "header\n".len(), "{lines} lines");
            let Some(until) = buffer.last_omitted_line() else {
                assert_eq!(kept.len(), lines);
                continue;
            };
            assert_eq!(kept.len() + until, lines + 1);
            assert_eq!(format!("{}\n", kept[1]), line(until + 1));
            assert!(kept[1].contains("planning"));
            let behind = streamed(&buffer, Some(until));
            let first = format!("id: {}\nevent: entry\ndata: {}\n", until + 1, kept[1]);
            assert!(behind.starts_with(&first), "{behind}");
            assert_eq!(behind.matches("event: entry").count(), lines - until);
            assert!(!behind.contains("missed"));
        }
    }

    #[test]
    fn new_lines_are_counted() {
        let buffer = filled(Some(3000), 600);
        let until = buffer.last_omitted_line().expect("600 lines are more");
        let short = Duration::from_millis(1);
        let late = buffer.lines_after(until - 7, short);
        assert_eq!((late.missed, late.last), (7, 600));
        assert_eq!(late.lines.len(), 600 - until);
        assert_eq!(format!("{}\n", late.lines[0]), line(until + 1));
        let last = buffer.lines_after(599, short);
        assert_eq!(last.lines, [line(600).trim_end()]);
        assert_eq!(buffer.lines_after(600, short).lines, [""; 0]);
        assert!(!last.is_finished);
        buffer.close();
        assert!(buffer.lines_after(600, Duration::MAX).is_finished);
    }

    #[test]
    fn trace_without_plan_is_shortened() {
        let buffer = TraceBuffer::with_limit(3000);
        buffer.add("header\n");
        let line = line(1);
        (2..=1000).for_each(|_| buffer.add(&line));
        let left = buffer.trace().len();
        assert!((1400..=3007).contains(&left), "{left} bytes");
    }

    #[test]
    fn slow_client_receives_number_of_omitted_lines() {
        let buffer = filled(Some(3000), 600);
        let until = buffer.last_omitted_line().expect("600 lines are more");
        let behind = streamed(&buffer, Some(17));
        let first = format!("event: missed\ndata: {}\n\nid: {}\n", until - 17, until + 1);
        assert!(behind.starts_with(&first), "{behind}");
    }
}
