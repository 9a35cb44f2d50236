//! How likely a plan is to succeed, and the order most likely to (Olisipo).
