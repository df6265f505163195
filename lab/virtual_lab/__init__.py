"""A virtual laboratory: simulated cells, protocols, instruments, campaigns of known truth.

The pipeline is tested on these campaigns. Nothing in here is shared with the models of
`cellwright`.
"""
