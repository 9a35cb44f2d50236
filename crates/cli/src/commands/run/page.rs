//! Page of a run that ends with its goal: the HTTP interface of `elbowroom run --serve`.

use std::sync::Arc;

use elbowroom::execute::RunInputs;
use elbowroom_executive::Error;
use elbowroom_executive::api::{self, ApiRouter};
use elbowroom_executive::operator::OperatorInterface;

use super::access;
use crate::args::RunArgs;
use crate::interrupt::Interrupt;
use crate::output;

/// Interface of a run, with its server if there is one.
pub(super) struct Page {
    pub(super) operator: OperatorInterface,
    router: Option<Arc<ApiRouter>>,
}

impl Page {
    /// Starts the HTTP interface of the arguments, and prints its address.
    ///
    /// # Errors
    /// When the token cannot be read, or the address is not available.
    pub(super) fn open(
        arguments: &RunArgs,
        inputs: &RunInputs,
        interrupt: &Interrupt,
    ) -> Result<Self, Error> {
        let Some(address) = arguments.serve else {
            return Ok(Self {
                operator: OperatorInterface::default(),
                router: None,
            });
        };
        let control = access(arguments, interrupt)?;
        let with_token = if control.is_some() {
            "; append #token=TOKEN to pause, cancel and stop the run there"
        } else {
            ""
        };
        let router = api::serve(address, None, control, None)?;
        let operator = router.begin_run(inputs)?;
        let own = router.address();
        output::print_to_stderr(&format!("the run is shown at http://{own}/{with_token}"));
        let router = Some(router);
        Ok(Self { operator, router })
    }

    /// Ends the interface: clients read the end of the run.
    pub(super) fn close(&self) {
        if let Some(router) = &self.router {
            router.close();
        }
    }
}
