"""The public interface: each step from DataFrames or columns to a typed result with `to_frame()`.

`import cellwright as cw` gives every function of this room as `cw.<step>`; docs/api.md shows them.
"""
