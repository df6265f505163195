"""Names of half cells as they stand in cells.tsv, of one material or of a blend; of the modes."""

# Of degradation: cyclable lithium lost, active material lost of either electrode.
MODES = ("lli", "lam_negative", "lam_positive")


def named_parts(text):
    """Names of the materials, and what is said of the share of the second; None where nothing is.

    Parameters
    ----------
    text : "a", "a+b" or "a+b:0.1"; a and b are names of the library or files, without a plus.

    Returns
    -------
    names : list of str. share : str or None, not read as a number yet.
    """
    if "+" not in text:
        return [text], None
    names, _, share = text.partition(":")
    return [name.strip() for name in names.split("+")], share.strip() or None


def half_cell_files(name) -> list[str]:
    """Files among the half cells that a value of cells.tsv names: what ends in .csv is a file."""
    parts, _ = named_parts(str(name or ""))
    return [part for part in parts if part.lower().endswith(".csv")]
