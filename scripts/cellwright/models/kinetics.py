"""Charge transfer of one cell in several branches: one asinh, shared by their resistances."""

import numpy as np

SMALLEST = 1e-9  # of a resistance [ohm] and of a share: none has no share to take


def with_shared_scale(circuit):
    """Kinetic branches of a cell follow one asinh: each has its share of the common scale.

    The share is taken where the resistances are looked up: between two knots or temperatures of
    which one holds no resistance, a share of its own would have no meaning.

    Parameters
    ----------
    circuit : tuple of Branch; `scale_volt` of each kinetic one is the common scale [V].

    Returns
    -------
    circuit : tuple of Branch, each kinetic one with its own scale.
    """
    kinetic = [branch.parameters["r_ohm"] for branch in circuit if branch.kind == "kinetic"]
    total = np.maximum(sum(kinetic), SMALLEST)

    def shared(parameters):
        share = np.maximum(parameters["r_ohm"] / total, SMALLEST)
        return parameters | {"scale_volt": share * parameters["scale_volt"]}

    return tuple(
        branch._replace(parameters=shared(branch.parameters))
        if branch.kind == "kinetic"
        else branch
        for branch in circuit
    )
