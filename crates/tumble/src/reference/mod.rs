//! L1: exact solutions.
