"""Methods of dQ/dV that lost against the rising curve of `cellwright.protocols.ica`, to compare."""
