//! What a run has recorded so far, for those who look at it.

use std::collections::VecDeque;
use std::io::{self, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// How often a client that hears nothing new is told so, in order to notice that it has gone.
const SIGN_OF_LIFE: Duration = Duration::from_secs(15);

/// How long clients have to fetch the end of the run.
const FAREWELL: Duration = Duration::from_secs(2);

/// Interval between two checks that a waiting client is still connected.
const GLANCE: Duration = Duration::from_millis(250);

/// A client that receives new lines.
pub(crate) trait Client: Write {
    /// Returns `true` if it has closed its connection.
    fn has_left(&mut self) -> bool;
}

/// The name of the trace on its page.
pub(crate) const NAME: &str = "the run";

/// How much of the trace is kept of a run that goes on, in bytes.
const MOST_KEPT: usize = 4_000_000;

/// The trace of a run so far; of a run that goes on for ever, only the last part of it.
#[derive(Clone, Default)]
pub(crate) struct Board(Arc<Shared>);

#[derive(Default)]
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
    /// The document of so many lines.
    document: Mutex<Option<(usize, Arc<str>)>>,
    /// The limit on what is kept, in bytes.
    most: Option<usize>,
}

#[derive(Default)]
struct State {
    /// The first line, which says what is run.
    header: Option<Arc<str>>,
    /// The last lines.
    kept: VecDeque<Arc<str>>,
    /// Their length.
    bytes: usize,
    /// How many lines there were between the header and these.
    left_out: usize,
    is_over: bool,
    /// Clients that wait for news.
    listeners: usize,
}

impl State {
    fn lines(&self) -> usize {
        usize::from(self.header.is_some()) + self.left_out + self.kept.len()
    }

    fn add(&mut self, line: &str) {
        if self.header.is_none() {
            self.header = Some(line.into());
        } else {
            self.bytes += line.len();
            self.kept.push_back(line.into());
        }
    }

    /// Throws the first lines away, up to where a plan was asked for, if there is such a place in
    /// what is left: a trace that begins there can be understood.
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
            self.left_out += 1;
        }
    }

    /// The lines behind so many, and whether some of them are no longer there.
    fn behind(&self, told: usize) -> (Vec<Arc<str>>, usize) {
        let header = self.header.iter().filter(|_| told == 0).cloned();
        let of_kept = told.saturating_sub(1 + self.left_out);
        let missed = (1 + self.left_out).saturating_sub(told.max(1));
        let news = header.chain(self.kept.iter().skip(of_kept).cloned());
        (news.collect(), missed)
    }

    fn trace(&self) -> String {
        let lines = self.header.iter().chain(&self.kept);
        lines.map(|line| &**line).collect()
    }
}

impl Board {
    /// Of a run that goes on for ever.
    pub(crate) fn lasting() -> Self {
        Self::keeping(MOST_KEPT)
    }

    fn keeping(most: usize) -> Self {
        Self(Arc::new(Shared {
            most: Some(most),
            ..Shared::default()
        }))
    }

    /// Adds a line of the trace, with its line feed.
    pub(crate) fn add(&self, line: &str) {
        let mut state = self.lock();
        state.add(line);
        if let Some(most) = self.0.most
            && state.bytes > most
        {
            state.shorten(most / 2);
        }
        drop(state);
        self.0.changed.notify_all();
    }

    /// The trace so far.
    pub(crate) fn trace(&self) -> String {
        self.lock().trace()
    }

    /// Up to which line of the trace those behind the first one are no longer there.
    pub(crate) fn left_out_until(&self) -> Option<usize> {
        let left_out = self.lock().left_out;
        (left_out > 0).then_some(left_out + 1)
    }

    /// Says that the run is over, and waits a little for clients that fetch how it ended.
    pub(crate) fn close(&self) {
        let mut state = self.lock();
        state.is_over = true;
        self.0.changed.notify_all();
        let waits = |state: &mut State| state.listeners > 0;
        state = self
            .0
            .changed
            .wait_timeout_while(state, FAREWELL, waits)
            .unwrap_or_else(PoisonError::into_inner)
            .0;
        drop(state);
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // A thread that failed while it held the lock has left whole lines.
        let state = self.0.state.lock();
        state.unwrap_or_else(PoisonError::into_inner)
    }

    /// What the page shows now, as JSON; made once for all clients.
    pub(crate) fn document(&self) -> Result<Arc<str>, String> {
        let cached = self.0.document.lock();
        let mut cached = cached.unwrap_or_else(PoisonError::into_inner);
        let (lines, left_out, trace) = {
            let state = self.lock();
            if let Some((lines, document)) = &*cached
                && *lines == state.lines()
            {
                return Ok(Arc::clone(document));
            }
            (state.lines(), state.left_out, state.trace())
        };
        let document = elbowroom_page::live_document(NAME, &trace, left_out)
            .map_err(|error| error.to_string())?;
        let text = serde_json::to_string(&document).map_err(|error| error.to_string())?;
        let text: Arc<str> = text.into();
        *cached = Some((lines, Arc::clone(&text)));
        Ok(text)
    }

    /// The page as it is now.
    pub(crate) fn page(&self) -> Result<String, String> {
        let (trace, left_out) = {
            let state = self.lock();
            (state.trace(), state.left_out)
        };
        elbowroom_page::live_page(NAME, &trace, left_out).map_err(|error| error.to_string())
    }

    /// Tells a client of every change, until the run is over or the client has gone.
    pub(crate) fn tell_changes(&self, client: &mut dyn Client) -> io::Result<()> {
        self.listened(|| self.tell_all_changes(client))
    }

    /// Tells a client every line of the trace behind line `after`, or from now on, until the run is
    /// over or the client has gone.
    pub(crate) fn tell_lines(
        &self,
        after: Option<usize>,
        client: &mut dyn Client,
    ) -> io::Result<()> {
        self.listened(|| self.tell_all_lines(after, client))
    }

    fn listened(&self, tell: impl FnOnce() -> io::Result<()>) -> io::Result<()> {
        self.lock().listeners += 1;
        let told = tell();
        self.lock().listeners -= 1;
        self.0.changed.notify_all();
        told
    }

    /// Waits until there are more than `told` lines, or none will come, or for a while.
    ///
    /// # Errors
    /// When the client has left.
    fn await_lines(
        &self,
        told: usize,
        client: &mut dyn Client,
    ) -> io::Result<MutexGuard<'_, State>> {
        let waits = |state: &mut State| state.lines() <= told && !state.is_over;
        let mut waited = Duration::ZERO;
        loop {
            let changed = &self.0.changed;
            let state = changed.wait_timeout_while(self.lock(), GLANCE, waits);
            let (state, timeout) = state.unwrap_or_else(PoisonError::into_inner);
            waited += GLANCE;
            if !timeout.timed_out() || waited >= SIGN_OF_LIFE {
                return Ok(state);
            }
            drop(state);
            if client.has_left() {
                return Err(io::ErrorKind::ConnectionAborted.into());
            }
        }
    }

    fn tell_all_changes(&self, client: &mut dyn Client) -> io::Result<()> {
        let mut told = 0;
        loop {
            let (lines, is_over) = {
                let state = self.await_lines(told, client)?;
                (state.lines(), state.is_over)
            };
            if is_over {
                let document = self.document().map_err(io::Error::other)?;
                write!(client, "event: over\ndata: {document}\n\n")?;
                return client.flush();
            }
            if lines == told {
                client.write_all(b": nothing new\n\n")?;
            } else {
                told = lines;
                write!(client, "event: change\ndata: {lines}\n\n")?;
            }
            client.flush()?;
        }
    }

    fn tell_all_lines(&self, after: Option<usize>, client: &mut dyn Client) -> io::Result<()> {
        let mut told = after.unwrap_or_else(|| self.lock().lines());
        loop {
            let (news, missed, lines, is_over) = {
                let state = self.await_lines(told, client)?;
                told = told.min(state.lines());
                let (news, missed) = state.behind(told);
                (news, missed, state.lines(), state.is_over)
            };
            if missed > 0 {
                // It has read too slowly, and is told how much it has not heard.
                write!(client, "event: missed\ndata: {missed}\n\n")?;
            }
            let first = lines - news.len();
            for (number, line) in (first + 1..).zip(&news) {
                write!(client, "id: {number}\nevent: entry\ndata: {line}\n")?;
            }
            told = lines;
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
    use super::{Board, Client};

    impl Client for Vec<u8> {
        fn has_left(&mut self) -> bool {
            false
        }
    }

    /// Lines of which every fifth is where a plan is asked for.
    fn line(number: usize) -> String {
        let event = if number.is_multiple_of(5) {
            "planning"
        } else {
            "passed"
        };
        format!("{{\"event\":\"{event}\",\"now\":{number:04}}}\n")
    }

    fn board(most: Option<usize>, lines: usize) -> Board {
        let board = most.map_or_else(Board::default, Board::keeping);
        board.add("header\n");
        (2..=lines).for_each(|number| board.add(&line(number)));
        board
    }

    fn told(board: &Board, after: Option<usize>) -> String {
        let mut told = Vec::new();
        board.lock().is_over = true;
        board.tell_lines(after, &mut told).expect("to memory");
        String::from_utf8(told).expect("text")
    }

    #[test]
    fn a_run_that_ends_is_kept_whole() {
        let board = board(None, 1000);
        assert_eq!(board.trace().lines().count(), 1000);
        assert_eq!(board.left_out_until(), None);
        assert_eq!(told(&board, Some(0)).matches("event: entry").count(), 1000);
        assert!(told(&board, Some(998)).starts_with("id: 999\n"));
    }

    /// However long it goes on, what is kept is its header and a last part of limited length, which
    /// begins with a plan; each line keeps its number.
    #[test]
    fn of_a_run_that_goes_on_the_last_part_is_kept() {
        let most = 3000;
        for lines in (2..600).step_by(7) {
            let board = board(Some(most), lines);
            let trace = board.trace();
            let kept: Vec<&str> = trace.lines().collect();
            assert_eq!(kept[0], "header");
            assert!(trace.len() <= most + "header\n".len(), "{lines} lines");
            let Some(until) = board.left_out_until() else {
                assert_eq!(kept.len(), lines);
                continue;
            };
            assert_eq!(kept.len() + until, lines + 1);
            assert_eq!(format!("{}\n", kept[1]), line(until + 1));
            assert!(kept[1].contains("planning"));
            let behind = told(&board, Some(until));
            let first = format!("id: {}\nevent: entry\ndata: {}\n", until + 1, kept[1]);
            assert!(behind.starts_with(&first), "{behind}");
            assert_eq!(behind.matches("event: entry").count(), lines - until);
            assert!(!behind.contains("missed"));
        }
    }

    #[test]
    fn without_a_new_plan_the_last_part_is_kept_all_the_same() {
        let board = Board::keeping(3000);
        board.add("header\n");
        let line = line(1);
        (2..=1000).for_each(|_| board.add(&line));
        let left = board.trace().len();
        assert!((1400..=3007).contains(&left), "{left} bytes");
    }

    #[test]
    fn who_reads_too_slowly_is_told_how_much_was_missed() {
        let board = board(Some(3000), 600);
        let until = board.left_out_until().expect("600 lines are more");
        let behind = told(&board, Some(17));
        let first = format!("event: missed\ndata: {}\n\nid: {}\n", until - 17, until + 1);
        assert!(behind.starts_with(&first), "{behind}");
    }
}
