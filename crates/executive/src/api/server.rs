//! Listeners of the HTTP interface.

use std::fmt;
use std::net::TcpListener;
use std::path::Path;
use std::sync::Arc;

use elbowroom::execute::NamedText;

use super::ApiRouter;
use crate::error::Error;
use crate::http::{self, AccessControl, Address, Listener};
use crate::messages::io_error_message;

/// Serves the HTTP interface of an executive or a run at a TCP address, and at a Unix socket if a path is given, until
/// the program ends. Without `control`, clients can only read. `domain` is the domain of the problems that clients may
/// submit to an executive; a run that ends with its goal has none.
///
/// # Errors
/// When an address is not available.
pub fn serve(
    address: Address,
    socket_path: Option<&Path>,
    control: Option<AccessControl>,
    domain: Option<&NamedText>,
) -> Result<Arc<ApiRouter>, Error> {
    let address = address.0;
    let cannot = |why: &dyn fmt::Display| {
        Error::new(
            format!("cannot listen at {address}: {why}"),
            "choose another port; with port 0, a free one is taken",
        )
    };
    let listener = TcpListener::bind(address).map_err(|error| cannot(&io_error_message(&error)))?;
    let own = listener
        .local_addr()
        .map_err(|error| cannot(&io_error_message(&error)))?;
    let socket = socket_path.map(socket).transpose()?;
    let router = Arc::new(ApiRouter::new(control, own, domain.cloned()));
    for (listener, is_local_only) in [
        (Some(Listener::Tcp(listener)), own.ip().is_loopback()),
        (socket, false),
    ] {
        let Some(listener) = listener else { continue };
        let (served, known) = (Arc::clone(&router), Arc::clone(&router));
        let is_known = move |request: &http::Request| known.is_known(request);
        http::serve(listener, is_known, move |request, stream| {
            served.serve(request, is_local_only, stream)
        });
    }
    Ok(router)
}

/// Binds a Unix socket that only its owner can connect to. A stale socket file is replaced.
#[cfg(unix)]
fn socket(path: &Path) -> Result<Listener, Error> {
    use std::os::unix::fs::PermissionsExt as _;
    use std::os::unix::net::{UnixListener, UnixStream};

    let cannot = |why: &dyn fmt::Display| {
        Error::new(
            format!("cannot listen at {}: {why}", path.display()),
            "choose a path that does not exist yet, in an existing folder with write permission",
        )
    };
    let is_socket = std::fs::symlink_metadata(path)
        .is_ok_and(|it| std::os::unix::fs::FileTypeExt::is_socket(&it.file_type()));
    if is_socket {
        if UnixStream::connect(path).is_ok() {
            return Err(cannot(&"another program listens there"));
        }
        let _ = std::fs::remove_file(path);
    }
    let listener = UnixListener::bind(path).map_err(|error| cannot(&io_error_message(&error)))?;
    let owner_only = std::fs::Permissions::from_mode(0o600);
    std::fs::set_permissions(path, owner_only)
        .map_err(|error| cannot(&io_error_message(&error)))?;
    Ok(Listener::Unix(listener))
}

#[cfg(not(unix))]
fn socket(path: &Path) -> Result<Listener, Error> {
    Err(Error::new(
        format!(
            "cannot listen at {}: this system has no Unix sockets",
            path.display()
        ),
        "leave out --socket; --http serves the same",
    ))
}
