//! Predicted errors of a machine.
