"""The public interface: each step of the method is one function that gives one `Result`.

`import cellwright as cw` gives every step as `cw.<step>`: from the room that it belongs to, or from
this one what stands on several rooms at once; docs/api.md shows them.
An argument means the same in every step:

series : DataFrame, columns or result of `clean`, (n,) each: test_time_second [s], current_ampere
    [A], positive on charge, voltage_volt [V], charge_ampere_hour [Ah], and others.
steps : result of `segment`, or a table of its columns.
cell, test : CellFacts and TestFacts, or mappings with the columns of cells.tsv and tests.tsv.
cells : CellFacts or mappings, in any order.
tests : (test, series) each.
basis : result of `basis`, its content, a model, or the path of results/stages/basis/<cell>.json.
model, models : result of `identify` or `finish_model`, its content, or the path of
    results/models/<cell>.json; of a pack one for each cell, in any order.
branches, members : rows of groups.tsv of a group, and of all groups in it.
capacities, resistances, spectra : rows of `capacity`, `resistance`, `impedance` with test,
    ambient_temperature_celsius and cycle: a table of them, or (test, result) each.
course : result of `course`: how the test before left the cell.
repeats : result of `repeats` of the cell's tests: what counts in another test is left out.
settings, changes : value of the class of `cw.settings` that a step names, or its keys as keywords.
split_rest_second : shortest rest that cuts a test of role split into blocks [s].

A step raises `Refusal` where the data do not allow its answer, and says what was found and what is
needed.
"""
